"""What a system of a table is given of a store's windows, and what it makes of them, whatever kind of network it is."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Any

import numpy as np

from ...corpora.store import Store, gather
from ...errors import InputError
from ...motion.rotations import Array
from ...training.audio_source import with_audio
from ...training.texts import with_text
from .runs import PlayableRun

__all__ = ["StoreInputs", "find_context", "generate_rows"]


class StoreInputs:
    """The arrays of windows of a store, as networks take them.

    Args:
        store: whose windows they are.
    """

    def __init__(self, store: Store) -> None:
        self._store, self._with_text = store, cache(partial(with_text, store))

    def gather(self, player: PlayableRun, starts: Array, frames: int, speakers: Sequence[str]) -> dict[str, Array]:
        """All arrays that a network takes, poses and audio standardised.

        Args:
            player: the network.
            starts: (N,) rows of the store where the windows begin.
            frames: of a window.
            speakers: (N,) who speaks.

        Returns:
            Name → (N, frames, …), and ``speaker`` (N,): its place among the speakers of the training, −1 for a stranger.

        Raises:
            InputError: the store lacks an input of it.
        """
        names, found = [name for name in player.net.arrays if name != "semantic"], dict[str, Array]()
        data = player.facts["recipe"]["data"]
        store = with_audio(self._with_text(data.get("words")) if "text" in names else self._store, data.get("audio"))
        for name in names:
            if name not in store.arrays:
                raise InputError(f"{type(player.net).__name__} wants {name!r}, which the store lacks", "prepare it with that")
            found[name] = gather(store.arrays[name], starts, frames)
        known = player.speakers
        found["speaker"] = np.array([known.index(name) if name in known else -1 for name in speakers])
        standards = {"pose": player.pose, "audio": player.audio}
        return found | {name: standard(found[name]) for name, standard in standards.items() if name in found}


def find_context(player: PlayableRun, given: int) -> tuple[int, int]:
    """Frames before and after what is made that a network is given: those of its settings, or ``given`` and none."""
    return player.context if hasattr(player.net.config, "history") else (given, 0)


def generate_rows(
    player: PlayableRun, inputs: StoreInputs, starts: Array, frames: int, speakers: Sequence[str], *, given: int, seed: int
) -> Array:
    """Poses that follow recorded ones, in the units of the store.

    Args:
        player: a flow; a network with ``play``, of many inputs; or one that makes windows of speech alone.
        inputs: of the store.
        starts: (N,) rows of the store where the poses that are made begin.
        frames: of them.
        speakers: (N,) who speaks.
        given: poses before them that a network without a history of its own is given.
        seed: of the latents of a flow, or of the noise of a network that takes some, one draw for a window.

    Returns:
        (N, frames, D).
    """
    from ...models.nn.seeded_windows import SeededWindows
    from ..playing import perform, play, play_inputs

    net: Any = player.net
    before, after = find_context(player, given)
    most = net.window - before if isinstance(net, SeededWindows) else frames
    if frames > most:  # window by window, each behind recorded poses; the last one ends with the frames
        firsts = [min(k, frames - most) for k in range(0, frames, most)]
        parts = [generate_rows(player, inputs, starts + k, most, speakers, given=given, seed=seed) for k in firsts]
        return np.concatenate(
            [part[:, k - first :] for part, k, first in zip(parts, range(0, frames, most), firsts, strict=True)], 1
        )
    arrays = inputs.gather(player, starts - before, before + frames + after, speakers)
    if hasattr(net, "play"):
        modes = int(getattr(net, "modes", 0)) if isinstance(net, SeededWindows) else 0
        noise = np.random.default_rng(seed).normal(size=(len(starts), 1, modes)) if modes else None
        made = play_inputs(net, arrays, noise=noise)["pose"][:, before : before + frames]
    elif hasattr(net, "make"):
        styles = {name: player.style(name) for name in {*speakers}}
        made = play(net, arrays["audio"], np.stack([styles[name] for name in speakers]))[:, before : before + frames]
    else:
        made = perform(net, arrays["pose"][:, :before], arrays["audio"], seed=seed)
    return player.unpose(made)
