"""The gesture space (Mix-StAGE, figure 2): motion of a network as points in the plane, for own speech and for others' speech.

A point is a window of 64 frames *as it was made*: mean and deviation of each number of its standardised poses over the window.
The paper draws "the gesture space generated from the audio content and style". It does not say which numbers of the network
these are. We take the poses: every network has them, so that networks can be compared. Φ or Z of one network have no
counterpart in another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...corpora.store import Store, gather
from ...errors import InputError
from ...motion.rotations import Array
from ..figures.scatter import Panel, draw_map
from .heatmaps import FRAMES, windows_of
from .runs import PlayableRun
from .tsne import tsne

__all__ = ["GestureSpace", "draw_gesture_space", "gesture_space"]

Pictures = NDArray[np.uint8]

WINDOWS = 48  # ours: at most, of each style in each of the two panels; t-SNE is quadratic in their number


@dataclass(frozen=True, eq=False)
class GestureSpace:
    """Windows that were made, as points.

    Args:
        preserved: (N, 2 D) of own speech; by style as in ``preserved_styles``.
        transferred: (M, 2 D) of others' speech.
        preserved_styles, transferred_styles: (N,) and (M,) names.
    """

    preserved: Array
    transferred: Array
    preserved_styles: tuple[str, ...]
    transferred_styles: tuple[str, ...]

    def hits(self) -> tuple[float, float]:
        """Share of the preserved and of the transferred windows whose nearest (other) preserved window has the same style."""
        styles = np.array(self.preserved_styles)
        shares = []
        for points, own in ((self.preserved, styles), (self.transferred, np.array(self.transferred_styles))):
            gap = np.square(points).sum(1)[:, None] + np.square(self.preserved).sum(1) - 2 * points @ self.preserved.T
            if points is self.preserved:
                np.fill_diagonal(gap, np.inf)
            shares.append(float((styles[gap.argmin(1)] == own).mean()))
        return shares[0], shares[1]


def _features(poses: Array) -> Array:
    """(n, T, D) → (n, 2 D) mean and deviation over each window."""
    poses = np.asarray(poses, np.float64)
    return np.concatenate([poses.mean(1), poses.std(1)], 1)


def gesture_space(player: PlayableRun, store: Store, speakers: Sequence[str] = (), *, seed: int = 0) -> GestureSpace:
    """Motion of a network for the test clips: each style with the speech of its own speaker, and with that of all others.

    Args:
        player: a network played by windows (`cospeech.models.nn.windowed.Windowed`).
        store: the speech is that of its test clips.
        speakers: whose styles and speech; (): all speakers of the network.
        seed: of the choice of windows.

    Raises:
        InputError: fewer than two speakers, one that network or store does not know, or another network.
    """
    from ..playing import play

    names = list(speakers or player.speakers)
    if len(set(names)) < 2:
        raise InputError(f"a gesture space of {len(set(names))} speakers", "two at least")
    starts = {name: windows_of(store, name, WINDOWS, seed) for name in names}
    spaces: tuple[list[Array], list[Array]] = ([], [])
    labels: tuple[list[str], list[str]] = ([], [])
    for name in names:
        own = starts[name]
        strange = np.concatenate([rows for other, rows in starts.items() if other != name])
        some = np.random.default_rng([seed, *name.encode()]).permutation(len(strange))[: len(own)]  # as many as of its own
        for k, firsts in enumerate((own, strange[np.sort(some)])):
            audio = player.audio(gather(store.arrays["audio"], firsts, FRAMES))
            spaces[k].append(_features(play(player.net, audio, player.style(name))))
            labels[k].extend([name] * len(firsts))
    return GestureSpace(np.concatenate(spaces[0]), np.concatenate(spaces[1]), tuple(labels[0]), tuple(labels[1]))


def draw_gesture_space(player: PlayableRun, store: Store, speakers: Sequence[str] = (), *, seed: int = 0) -> Pictures:
    """A panel of own speech beside one of others' speech, a colour for each style; one t-SNE embeds all windows.

    Args:
        player, store, speakers, seed: as of `gesture_space`.

    Raises:
        InputError: as `gesture_space`.
    """
    space = gesture_space(player, store, speakers, seed=seed)
    plane, count = tsne(np.concatenate([space.preserved, space.transferred])), len(space.preserved)
    preserved, transferred = plane[:count], plane[count:]
    chance = 1 / len(set(space.preserved_styles))
    texts = [f"nearest window of own speech: the same style in {hit:.0%} (chance {chance:.0%})" for hit in space.hits()]
    return draw_map(
        [
            Panel("Style preserved: own speech", texts[0], preserved, space.preserved_styles, transferred),
            Panel("Style transferred: others' speech", texts[1], transferred, space.transferred_styles, preserved),
        ]
    )
