"""The inputs of a system of a table, from windows of a store, and the poses that it makes, for any kind of network."""

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
            Name → (N, frames, …), and ``speaker`` (N,): the place among the speakers of the training, −1 for any other speaker.

        Raises:
            InputError: the store lacks an input of the network.
        """
        names, arrays = [name for name in player.net.arrays if name != "semantic"], dict[str, Array]()
        data = player.facts["recipe"]["data"]
        store = with_audio(self._with_text(data.get("words")) if "text" in names else self._store, data.get("audio"))
        for name in names:
            if name not in store.arrays:
                raise InputError(f"{type(player.net).__name__} wants {name!r}, which the store lacks", "prepare it with that")
            arrays[name] = gather(store.arrays[name], starts, frames)
        training_speakers = player.speakers
        arrays["speaker"] = np.array([training_speakers.index(name) if name in training_speakers else -1 for name in speakers])
        standards = {"pose": player.pose, "audio": player.audio}
        return arrays | {name: standard(arrays[name]) for name, standard in standards.items() if name in arrays}


def find_context(player: PlayableRun, seed_frames: int) -> tuple[int, int]:
    """How many frames a network is given before and after those that it makes: by its settings, else ``seed_frames`` and 0."""
    return player.context if hasattr(player.net.config, "history") else (seed_frames, 0)


def generate_rows(
    player: PlayableRun,
    inputs: StoreInputs,
    starts: Array,
    frames: int,
    speakers: Sequence[str],
    *,
    seed_frames: int,
    seed: int,
) -> Array:
    """Generate poses that follow recorded ones, in the units of the store.

    Args:
        player: a flow; a network with ``play``, of many inputs; or one that makes windows of speech alone.
        inputs: of the store.
        starts: (N,) rows of the store where the generated poses begin.
        frames: number of generated poses.
        speakers: (N,) who speaks.
        seed_frames: number of poses before them that a network without a history of its own is given.
        seed: of the latents of a flow, or of the noise of a network that takes some, one draw for each window.

    Returns:
        (N, frames, D).
    """
    from ...models.nn.seeded_windows import SeededWindows
    from ..playing import perform, play, play_inputs

    net: Any = player.net
    before, after = find_context(player, seed_frames)
    most = net.window - before if isinstance(net, SeededWindows) else frames
    if frames > most:  # window by window, each behind recorded poses; the last one ends at the last frame
        firsts = [min(k, frames - most) for k in range(0, frames, most)]
        parts = [generate_rows(player, inputs, starts + k, most, speakers, seed_frames=seed_frames, seed=seed) for k in firsts]
        return np.concatenate(
            [part[:, k - first :] for part, k, first in zip(parts, range(0, frames, most), firsts, strict=True)], 1
        )
    arrays = inputs.gather(player, starts - before, before + frames + after, speakers)
    if hasattr(net, "play"):
        modes = int(getattr(net, "modes", 0)) if isinstance(net, SeededWindows) else 0
        noise = np.random.default_rng(seed).normal(size=(len(starts), 1, modes)) if modes else None
        poses = play_inputs(net, arrays, noise=noise)["pose"][:, before : before + frames]
    elif hasattr(net, "make"):
        styles = {name: player.style(name) for name in {*speakers}}
        poses = play(net, arrays["audio"], np.stack([styles[name] for name in speakers]))[:, before : before + frames]
    else:
        poses = perform(net, arrays["pose"][:, :before], arrays["audio"], seed=seed)
    return player.unpose(poses)
