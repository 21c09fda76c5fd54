"""Figures of a table: poses of all systems above their speech (figure 5 of the paper), latents in two dimensions (figure 8)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from os import PathLike
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...audio.speech import Word
from ...corpora.samples import load_stored_clips
from ...corpora.store import Entry, Store
from ...errors import InputError
from ...export.render.strip import Sound
from ...files import atomic
from ...motion.motion import Motion
from ...motion.rotations import Array
from ...motion.skeletons.ted import JOINTS, PARENTS
from ..figures.scatter import Panel, draw_map
from ..figures.sticks import Sticks, draw_sticks
from .excerpts import Excerpts
from .runs import PlayableRun
from .scores import controls_of_latents, latents
from .tsne import tsne

__all__ = ["choose_excerpt", "draw_latents", "draw_poses", "write_picture"]

Pictures = NDArray[np.uint8]

SECONDS, CELLS = 6.0, 10  # seconds of speech and number of moments that are shown; ours
SOUND_STEP = 0.02  # s, of the waveform
_BARE = 0.08  # ours: level of the quietest speech in the picture, where only its energy is known


class TestData(Protocol):
    """The data that a figure shows."""

    store: Store
    pose: Any

    @property
    def raw(self) -> Any:
        """The corpus, for the sound; or None."""
        ...


def choose_excerpt(entries: Sequence[Entry], fps: float, before: int, after: int) -> tuple[Entry, int]:
    """The longest of some clips, and how many of its frames are shown, from frame ``before`` on."""
    entry = max(entries, key=lambda clip: clip.frames)
    return entry, min(round(SECONDS * fps), entry.frames - before - after)


def _words(excerpts: TestData, entry: Entry, first: int, frames: int) -> list[Word]:
    """Words of the frames that are shown, from the store; seconds from the first frame."""
    store = excerpts.store
    if "word" not in entry.has:
        return []
    numbers = np.asarray(store.arrays["word"][first : first + frames])
    edges = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist(), len(numbers)]
    runs = ((a, b, int(numbers[a])) for a, b in pairwise(edges))
    return [Word(store.words[k], a / store.fps, b / store.fps) for a, b, k in runs if k > 0]


def _sound(excerpts: TestData, entry: Entry, first: int, frames: int) -> Sound:
    """The waveform of the frames that are shown; without sound, from the energy of the frames in the store."""
    fps = excerpts.store.fps
    if excerpts.raw is None:
        column = excerpts.store.names["audio"].index("energy") if "energy" in excerpts.store.names["audio"] else 0
        energy = np.asarray(excerpts.store.arrays["audio"][first : first + frames, column], np.float64)
        low, high = energy.min(), max(energy.max(), energy.min() + 1e-9)
        level = _BARE + (1 - _BARE) * ((energy - low) / (high - low)) ** 3  # decibels, or nearly
        return Sound(1 / fps, level, 0.6 * level)
    speech = next(
        c.speech for c in load_stored_clips(excerpts.store.folder, split="test", raw=excerpts.raw) if c.name == entry.name
    )
    assert speech is not None
    start = speech.start + (first - entry.offset) / fps
    part = speech.window(start, start + frames / fps)
    size = max(1, round(SOUND_STEP * part.rate))
    blocks = part.samples[: len(part.samples) // size * size].reshape(-1, size)
    return Sound(size / part.rate, np.abs(blocks).max(1), np.sqrt(np.square(blocks).mean(1)))


def _find_parent(joint: int, parents: Sequence[int], keep: Sequence[int]) -> int:
    """Place in ``keep`` of the nearest joint above that is kept; −1: none."""
    above = int(parents[joint])
    while above >= 0 and above not in keep:
        above = int(parents[above])
    return keep.index(above) if above >= 0 else -1


def _sticks(excerpts: TestData, label: str, vectors: Array) -> Sticks:
    """Poses of the store as a row of figures."""
    body = excerpts.pose.decode(np.asarray(vectors, np.float64), excerpts.store.fps)
    if not isinstance(body, Motion):
        if body.values.shape[2] != 3:
            raise InputError(f"stick figures of {excerpts.store.pose}", "they are of bodies in space")
        return Sticks(label, body.values, PARENTS, JOINTS)
    skeleton = body.skeleton
    joints = getattr(excerpts.pose, "joints", skeleton.names)
    keep = [k for k, name in enumerate(skeleton.names) if k == 0 or name in joints]
    parents = [_find_parent(k, skeleton.parents, keep) for k in keep]
    positions = body.positions()[:, keep]
    return Sticks(label, positions - positions[:, :1], parents, [skeleton.names[k] for k in keep])


def draw_poses(systems: Mapping[str, Array], data: TestData, entry: Entry, before: int) -> Pictures:
    """The recording, and the poses that each system makes for its speech, above that speech.

    Args:
        systems: label of a row → (T, D) poses in the units of the store, all of the same frames.
        data: the store.
        entry: the clip that is shown.
        before: frames of it before the first that is shown.
    """
    first, frames = entry.offset + before, min(map(len, systems.values()))
    rows = [_sticks(data, "recording", data.store.arrays["pose"][first : first + frames])]
    rows += [_sticks(data, label, poses[:frames]) for label, poses in systems.items()]
    words, sound = _words(data, entry, first, frames), _sound(data, entry, first, frames)
    return draw_sticks(rows, data.store.fps, cells=CELLS, sound=sound, words=words)


def draw_latents(players: Mapping[str, PlayableRun], excerpts: Excerpts, cells: Mapping[str, Mapping[str, Any]]) -> Pictures:
    """Latents by t-SNE, coloured by speaker: a panel for each system, and one for the mean poses.

    Args:
        players: title of a panel → a trained system.
        excerpts: of the store.
        cells: title → column → cell of the table; the silhouette is written below the title.
    """
    speakers = excerpts.speakers()
    groups = [speakers[k].rstrip("_") for k in excerpts.apart]
    points = {name: latents(player, excerpts) for name, player in players.items()}
    name, poses = next(iter(controls_of_latents(excerpts).items()))
    panels = []
    for title, rows in {**points, name: poses}.items():
        score = cells.get(title, {}).get("silhouette", {})
        text = f"silhouette by speaker {score['mean']:.3f}" if "mean" in score else "t-SNE"
        panels.append(Panel(title, text, tsne(rows), groups))
    return draw_map(panels)


def write_picture(picture: Pictures, path: str | PathLike[str]) -> None:
    """Write a picture as PNG."""
    from PIL import Image

    with atomic(path) as temporary:
        Image.fromarray(picture).save(temporary, "PNG", optimize=True)
