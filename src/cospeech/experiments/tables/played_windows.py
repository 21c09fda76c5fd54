"""Windows of a system that plays windows: its inputs are gathered from the store, and its known poses are recorded ones."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from ...corpora.store import Store, gather
from ...motion.rotations import Array
from ...training.audio_source import with_audio
from ...training.texts import with_text
from .runs import PlayableRun

__all__ = ["NEW", "play_windows", "plays_windows"]

NEW = 30  # frames that a window makes after its known poses, where more are wanted than a window has; Yoon et al. 2020


def plays_windows(player: PlayableRun) -> bool:
    """Whether a system makes whole windows of all inputs that it is given, and not frame by frame."""
    return hasattr(player.net, "play")


@cache
def _with_text(folder: str, words: str | None) -> Store:
    return with_text(Store(folder), words)


def _store_of(player: PlayableRun, store: Store) -> Store:
    """A store with the arrays that a system takes."""
    data = player.facts["recipe"]["data"]
    if "text" in player.net.arrays:
        store = _with_text(str(store.folder), data.get("words"))
    return with_audio(store, data.get("audio"))


def play_windows(player: PlayableRun, store: Store, starts: Array, frames: int, *, seed: int) -> Array:
    """(N, frames, D) poses in the units of the store, from rows ``starts`` of it on.

    Args:
        player: of which `plays_windows`.
        store: the data.
        starts: (N,) row of the first frame that is made; recorded poses stand before it.
        frames: of each window.
        seed: of the noise, one draw for a window, where the network takes noise.
    """
    from ..playing import play_inputs

    store = _store_of(player, store)
    known = int(getattr(player.net, "seeds", 0))
    first = starts - known
    found: dict[str, Any] = {name: gather(store.arrays[name], first, known + frames) for name in player.net.arrays}
    whose = [next(c.speaker for c in reversed(store.clips) if c.offset <= start) for start in starts]
    found["speaker"] = np.array([player.speakers.index(name) if name in player.speakers else -1 for name in whose])
    standards = {"pose": player.pose, "audio": player.audio}
    found |= {name: standard(found[name]) for name, standard in standards.items() if name in found}
    modes = int(getattr(player.net, "modes", 0))
    noise = np.random.default_rng(seed).normal(size=(len(starts), 1, modes)) if modes else None
    made = play_inputs(player.net, found, noise=noise)["pose"][:, known:]
    return player.unpose(made)
