"""The store: a prepared corpus as a folder of plain, memory-mapped arrays and an index; random windows at full speed.

All clips lie end to end along the first axis of every array, N frames at one rate:

``pose.npy`` (N, D) float32; ``audio.npy`` (N, A) float32, at the same rate; ``face.npy`` (N, 52) float32; ``semantic.npy`` (N,)
float32; ``emotion.npy`` (N,) int8, index in `EMOTIONS`; ``word.npy`` (N,) int32, index in the index's ``words``, 0: silence;
``wav2vec.npy`` (N, 512) float16, features of wav2vec 2.0's CNN (`cospeech.models.nn.speech_encoder`);
``waveform.npy`` (N, 1080) float16, the samples of each frame (`cospeech.audio.features.waveform`);
``pose_mean.npy``, ``pose_std.npy``, ``audio_mean.npy``, ``audio_std.npy`` (1 + S, …) float32: all speakers, then each, over the
train split. What a clip lacks is NaN, or −1. ``index.json`` has the clips and all names.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from ..errors import InputError, nearest
from ..motion.rotations import Array
from .clip import SPLITS
from .lazy_rows import LazyRows
from .store_files import ARRAYS, NUMBERED, STATISTICS, Entry, open_array, read_entry, read_index

__all__ = ["ARRAYS", "NO_WINDOW", "STATISTICS", "Entry", "Store", "gather"]

NO_WINDOW = "longer clips; for a store without validation clips: data.validation=0.05, or train.validate_every=0"
"""The hint of an error where no clip of a split is long enough."""


class Store:
    """A store opened for reading; nothing is loaded until it is asked for.

    >>> store = Store("stores/beat")                                             # doctest: +SKIP
    >>> for batch in store.windows(64, batch=128, seed=0):                       # doctest: +SKIP
    ...     batch["pose"], batch["audio"]           # (128, 64, D), (128, 64, A)

    Raises:
        InputError: not a store, or its arrays are not what the index says.
    """

    def __init__(self, folder: str | PathLike[str]) -> None:
        self.folder = Path(folder)
        index = read_index(self.folder)
        try:
            self.corpus, self.pose = str(index["corpus"]), str(index["pose"])
            self.fps = float(index["fps"])
            self.speakers, self.words = tuple(map(str, index["speakers"])), tuple(map(str, index["words"]))
            self.names = {str(name): tuple(map(str, columns)) for name, columns in index["names"].items()}
            self.clips = tuple(map(read_entry, index["clips"]))
            shapes = {str(name): tuple(map(int, shape)) for name, shape in index["arrays"].items()}
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"the index of the store {str(self.folder)!r} is damaged: {error!r}"[:200]) from None
        array_names = (*ARRAYS, *(f"{name}_{what}" for name in NUMBERED for what in STATISTICS))
        kinds = {name: (ARRAYS.get(name, "<f4"), shape) for name, shape in shapes.items() if name in array_names}
        self.arrays = {name: open_array(self.folder / f"{name}.npy", *kind) for name, kind in kinds.items()}
        self._check()

    def __len__(self) -> int:
        """Frames of all clips."""
        return sum(clip.frames for clip in self.clips)

    def _check(self) -> None:
        """The clips cover the frames, each once and in order; the arrays have as many."""
        where = f"the store {str(self.folder)!r}"
        if "pose" not in self.arrays or not self.fps > 0:
            raise InputError(f"{where} has no poses or no frame rate", "is its index damaged?")
        at = 0
        for clip in self.clips:
            good = clip.offset == at and clip.frames > 0 and clip.split in SPLITS and clip.speaker in self.speakers
            if not good or not {*clip.has} <= {*self.arrays}:
                raise InputError(f"clip {clip.name!r} of {where} does not fit the others", "is its index damaged?")
            at += clip.frames
        for name, array in self.arrays.items():
            rows = at if name in ARRAYS else 1 + len(self.speakers)
            if len(array) != rows:
                raise InputError(f"{name}.npy of {where} has {len(array)} rows where {rows} belong", "prepare it again")

    def clip(self, which: Entry | int | str) -> dict[str, Array]:
        """Views of one clip's rows of all arrays that it has; by entry, number or name."""
        if isinstance(which, str):
            match = next((entry for entry in self.clips if entry.name == which), None)
            if match is None:
                raise InputError(f"no clip of the store is called {which!r}", f"{self.clips[0].name!r} is one")
            which = match
        entry = self.clips[which] if isinstance(which, int) else which
        return {name: self.arrays[name][entry.offset : entry.offset + entry.frames] for name in entry.has}

    def statistics(self, array: str = "pose", speaker: str | None = None) -> tuple[Array, Array]:
        """(D,) mean and (D,) standard deviation over the train split, of all speakers or of one.

        Raises:
            InputError: no such array or speaker.
        """
        if f"{array}_mean" not in self.arrays:
            raise InputError(f"no statistics of {array!r}", nearest(array, [n for n in NUMBERED if n in self.arrays]))
        if speaker is not None and speaker not in self.speakers:
            raise InputError(f"no speaker of the store is called {speaker!r}", nearest(speaker, self.speakers))
        row = 0 if speaker is None else 1 + self.speakers.index(speaker)
        mean, std = (np.array(self.arrays[f"{array}_{what}"][row]) for what in STATISTICS)
        return mean, std

    def starts(self, frames: int, split: str | None = "train", arrays: Sequence[str] = ("pose",)) -> tuple[Array, Array, Array]:
        """Where windows of so many frames can begin, none of which crosses from one clip into the next.

        Returns:
            (C,) numbers of the clips that are long enough and have all the arrays, (C,) their first row, (C,) how many
            windows each has.

        Raises:
            InputError: there is no such window.
        """
        unknown = [name for name in arrays if name not in ARRAYS or name not in self.arrays]
        if unknown:
            raise InputError(f"the store has no {unknown[0]!r}", f"it has {', '.join(n for n in ARRAYS if n in self.arrays)}")
        if split is not None and split not in SPLITS:
            raise InputError(f"no split is called {split!r}", nearest(split, SPLITS))
        own = [(k, clip) for k, clip in enumerate(self.clips) if split in (None, clip.split) and {*arrays} <= {*clip.has}]
        candidates = [(k, clip.offset, clip.frames - frames + 1) for k, clip in own if clip.frames >= frames]
        if frames < 1 or not candidates:
            longest = max((clip.frames for _, clip in own), default=0)
            has, hint = (f"its longest clip has {longest}", NO_WINDOW) if own else self._find_lacking(split, arrays)
            where = f"{split or 'whole'} split of {str(self.folder)!r}"
            raise InputError(f"no window of {frames} frames in the {where}: {has}", hint)
        numbers, offsets, counts = np.array(candidates, np.int64).T
        return numbers, offsets, counts

    def _find_lacking(self, split: str | None, arrays: Sequence[str]) -> tuple[str, str]:
        """Which of the arrays no clip of a split has, and what helps; for a split in which no clip has them all."""
        clips = [clip for clip in self.clips if split in (None, clip.split)]
        if not clips:
            return "it has no clips", NO_WINDOW
        lacking = [name for name in arrays if not any(name in clip.has for clip in clips)]
        what = ", ".join(lacking or [name for name in arrays if not all(name in clip.has for clip in clips)])
        hint = f"prepare it again from recordings that have {what}; docs/corpora says which files"
        return f"it has no clip with {what}{'' if lacking else ' together'}", hint

    def windows(
        self,
        frames: int,
        *,
        batch: int = 64,
        seed: int = 0,
        split: str | None = "train",
        arrays: Sequence[str] = ("pose", "audio"),
    ) -> Iterator[dict[str, Array]]:
        """Endless random windows: every start that lies within a clip is as likely as any other.

        Yields:
            name → (batch, frames, …) for each of ``arrays``, ``"speaker"`` (batch,) and ``"clip"`` (batch,) numbers, and
            ``"start"`` (batch,) rows. The same seed gives the same windows.
        """
        numbers, offsets, counts = self.starts(frames, split, arrays)
        ends, rng = np.cumsum(counts), np.random.default_rng(seed)
        place = {name: k for k, name in enumerate(self.speakers)}
        speaker = np.array([place[self.clips[k].speaker] for k in numbers])
        while True:
            draws = rng.integers(0, ends[-1], batch)
            which = np.searchsorted(ends, draws, "right")
            start = offsets[which] + draws - (ends[which] - counts[which])
            out = {name: gather(self.arrays[name], start, frames) for name in arrays}
            yield out | {"speaker": speaker[which], "clip": numbers[which], "start": start}


def gather(array: Array, starts: Array, frames: int) -> Array:
    """(B, frames, …): a copy of ``array[s : s + frames]`` for each of the starts, which must lie within the array."""
    if not len(starts) or starts.min() < 0 or starts.max() + frames > len(array):
        raise InputError(f"windows of {frames} frames outside an array of {len(array)}")
    if isinstance(array, LazyRows):
        return array.table[gather(array.index, starts, frames)]
    array = np.asarray(array)  # a memmap's own indexing is slower
    view = np.lib.stride_tricks.as_strided(
        array, (len(array) - frames + 1, frames, *array.shape[1:]), (array.strides[0], *array.strides), writeable=False
    )
    return view[starts]
