"""Training windows as a function of seed and step: there is no state to save, and any number of processes gets the same."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..corpora.store import NO_WINDOW, Store, gather
from ..errors import InputError
from ..motion.rotations import Array

__all__ = ["Windows", "is_mirror_image"]


def is_mirror_image(name: str) -> bool:
    """Whether a clip is the mirror image of another; see `cospeech.corpora.augment.mirror_clip`."""
    return name.endswith("|mirror")


class Windows:
    """All windows of a split of a store.

    Args:
        store: to draw from.
        frames: of a window.
        arrays: which must be there.
        split: train or validation.
        balanced: whether a batch has the same number of windows of each speaker, up to one.
        mirror: whether windows of mirrored clips are among them.
        held_out: share of the training clips that count as validation split, evenly from all of them, with their augmented
            copies.
        spare: arrays that a clip may lack; their values then mark them as missing.

    Raises:
        InputError: there is no such window.
    """

    def __init__(
        self,
        store: Store,
        frames: int,
        arrays: Sequence[str] = ("pose", "audio"),
        *,
        split: str = "train",
        balanced: bool = False,
        mirror: bool = True,
        held_out: float = 0.0,
        spare: Sequence[str] = (),
    ) -> None:
        self.store, self.frames, self.arrays, self.balanced = store, frames, tuple(arrays), balanced
        if unknown := [name for name in self.arrays if name not in store.arrays]:
            raise InputError(f"the store has no {unknown[0]!r}", f"it has {', '.join(store.arrays)}{_say_source(unknown[0])}")
        essential = [name for name in self.arrays if name not in spare]
        numbers, self._offsets, self._counts = store.starts(frames, "train" if held_out else split, essential)
        names = [store.clips[k].name for k in numbers]
        good = np.array([mirror or not is_mirror_image(name) for name in names])
        if held_out:
            bases = list(dict.fromkeys(name.split("|")[0] for name in names))
            turns = np.ceil(np.round(np.arange(len(bases) + 1) * held_out, 6))  # rises where the share is due
            hold_out = {name for name, rises in zip(bases, np.diff(turns) > 0, strict=True) if rises}
            good &= np.array([(name.split("|")[0] in hold_out) == (split == "validation") for name in names])
        if not good.any():
            hint = _ALL_HELD_OUT if held_out and split == "train" else NO_WINDOW
            raise InputError(f"no window of {frames} frames in the {split} split of {str(store.folder)!r}", hint)
        place = {name: k for k, name in enumerate(store.speakers)}
        self.clips, self._offsets, self._counts = numbers[good], self._offsets[good], self._counts[good]
        self._speakers = np.array([place[store.clips[k].speaker] for k in self.clips])
        order = np.argsort(self._speakers, kind="stable")  # so that the windows of a speaker are one range
        self.clips, self._offsets, self._counts = self.clips[order], self._offsets[order], self._counts[order]
        self._speakers, self._ends = self._speakers[order], np.cumsum(self._counts)

    def __len__(self) -> int:
        return int(self._ends[-1])

    def _draw(self, batch: int, rng: np.random.Generator) -> Array:
        """(batch,) numbers of windows."""
        if not self.balanced:
            return rng.integers(0, len(self), batch)
        present = np.unique(self._speakers)
        rounds = -(-batch // len(present))
        speakers = np.concatenate([rng.permutation(present) for _ in range(rounds)])[:batch]
        first = np.searchsorted(self._speakers, speakers, "left")
        last = np.searchsorted(self._speakers, speakers, "right") - 1
        return rng.integers(self._ends[first] - self._counts[first], self._ends[last])

    def at(self, batch: int, seed: int, step: int, *, rank: int = 0, parts: int = 1) -> dict[str, Array]:
        """The batch of a step; for one of several processes, its share of the rows, from ``rank · batch / parts`` on.

        Returns:
            name → (rows, frames, …) for each array; ``"speaker"``, ``"clip"`` and ``"start"`` (rows,), as `Store.windows` has.
        """
        numbers = self._draw(batch, np.random.default_rng([seed, step]))
        rows = batch // parts
        numbers = numbers[rank * rows : (rank + 1) * rows]
        which = np.searchsorted(self._ends, numbers, "right")
        start = self._offsets[which] + numbers - (self._ends[which] - self._counts[which])
        arrays = {name: gather(self.store.arrays[name], start, self.frames) for name in self.arrays}
        return arrays | {"speaker": self._speakers[which], "clip": self.clips[which], "start": start}


_ALL_HELD_OUT = "data.validation holds all clips out: leave it out, and set train.validate_every=0"
_SOURCES = {
    "face": "a face beside the sound (docs/corpora)",
    "word": "words beside the sound (docs/transcripts.md)",
    "text": "words beside the sound (docs/transcripts.md)",
    "emotion": "an emotion: of a folder, emotions.csv tells it",
}


def _say_source(array: str) -> str:
    """Where a store has an array from, for a hint."""
    return f"; one recording at least needs {_SOURCES[array]}" if array in _SOURCES else ""
