"""Heat maps of styles by voices (Mix-StAGE, figure 7): a column has one style, a row one person's speech."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...corpora.store import Store, gather
from ...errors import InputError
from ...motion.points import Points
from ...motion.poses import find_pose
from ...motion.poses.keypoints2d import points_of
from ...motion.rotations import Array
from ..figures.heat import FIGURES, draw_heat
from .runs import PlayableRun

__all__ = ["FRAMES", "draw_heatmaps", "draw_recordings", "window_points", "windows_of"]

Pictures = NDArray[np.uint8]

FRAMES = 64  # authors' code: of a window, 4.3 s at 15 frames per second
SECONDS = 60.0  # ours: in each cell, at most; more does not change where arms move


def windows_of(store: Store, speaker: str, most: int, seed: int, split: str | None = "test") -> Array:
    """(n,) first rows of windows of `FRAMES` frames that do not overlap, in a speaker's clips: ``most`` of them, at random.

    Raises:
        InputError: there is no window.
    """
    numbers, offsets, counts = store.starts(FRAMES, split, ("pose", "audio"))
    own = [
        offset + np.arange(0, count, FRAMES)
        for number, offset, count in zip(numbers, offsets, counts, strict=True)
        if store.clips[number].speaker == speaker
    ]
    if not own:
        raise InputError(f"no {split or ''} clip of {speaker!r} has {FRAMES} frames".replace("  ", " "), "a longer split")
    starts = np.concatenate(own)
    indices = np.random.default_rng([seed, *speaker.encode()]).permutation(len(starts))[:most]
    return np.asarray(starts[np.sort(indices)])


def window_points(store: Store, rows: Array) -> tuple[list[Array], str]:
    """Poses in the units of a store (n, T, D) as key points (T, J, 2 or 3) of each window, and their layout."""
    pose, key_points, layout = find_pose(store.pose), [], "pats"
    for window in rows:
        body = pose.decode(np.asarray(window, np.float64), store.fps)
        points = body if isinstance(body, Points) else points_of(body)
        key_points.append(points.values)
        layout = points.layout
    return key_points, layout


def _load_recordings(store: Store, speaker: str, seed: int, split: str | None) -> tuple[list[Array], str]:
    """A speaker's recordings as `window_points` gives them."""
    starts = windows_of(store, speaker, max(1, round(SECONDS * store.fps / FRAMES)), seed, split)
    return window_points(store, gather(store.arrays["pose"], starts, FRAMES))


def draw_recordings(store: Store, speakers: Sequence[str] = (), *, rows: int = 2, title: str = "", seed: int = 0) -> Pictures:
    """Where the arms move in recordings: a column for each speaker, a minute of any split in each row.

    Args:
        store: the recordings.
        speakers: columns; (): all.
        rows: number of minutes; each is drawn at random, so that they differ as much as minutes do.
        title: of the whole picture.
        seed: of the draw.

    Raises:
        InputError: a speaker without windows.
    """
    columns = list(speakers or store.speakers)
    grid = [[_load_recordings(store, name, seed + row, None) for name in columns] for row in range(rows)]
    cells, labels = [[points for points, _ in row] for row in grid], ["a minute", *["another"] * (rows - 1)]
    return draw_heat(cells, FIGURES[grid[0][0][1]], store.fps, columns=columns, rows=labels, title=title)


def draw_heatmaps(
    player: PlayableRun,
    store: Store,
    styles: Sequence[str] = (),
    voices: Sequence[str] = (),
    *,
    title: str = "Where the arms move: a style in each column, whose speech in each row",
    seed: int = 0,
) -> Pictures:
    """Where the arms move for every voice in every style, below the recordings of the speakers of the styles.

    Args:
        player: a network played by windows (`cospeech.models.nn.windowed.Windowed`).
        store: the speech is that of its test clips.
        styles: speakers, a column each; (): all speakers of the network.
        voices: speakers of the speech, a row each; (): those of the styles.
        title: of the whole picture, such as the name of the network.
        seed: of the choice of windows, a minute of each voice.

    Raises:
        InputError: a speaker that the network or the store does not know, or another network.
    """
    from ..playing import play

    columns = list(styles or player.speakers)
    codes, most = [player.style(name) for name in columns], max(1, round(SECONDS * store.fps / FRAMES))
    recordings = [_load_recordings(store, name, seed, "test") for name in columns]
    cells, rows, layout = [[points for points, _ in recordings]], ["recordings"], recordings[0][1]
    for voice in voices or columns:
        audio = player.audio(gather(store.arrays["audio"], windows_of(store, voice, most, seed), FRAMES))
        motions = [player.unpose(play(player.net, audio, style)) for style in codes]
        cells.append([window_points(store, vectors)[0] for vectors in motions])
        rows.append(f"{voice}'s speech")
    return draw_heat(cells, FIGURES[layout], store.fps, columns=columns, rows=rows, title=title)
