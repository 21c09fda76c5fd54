"""Figures 2 and 7 of Mix-StAGE: what is played for whom, and what the points and cells are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from cospeech.corpora.store import Entry, Store  # noqa: E402
from cospeech.corpora.store_writer import Piece, write_store  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.experiments.figures.scatter import Panel, draw_map  # noqa: E402
from cospeech.experiments.tables import gesture_space as spaces  # noqa: E402
from cospeech.experiments.tables import heatmaps  # noqa: E402
from cospeech.experiments.tables.runs import PlayableRun  # noqa: E402
from cospeech.models.nn.windowed import Windowed  # noqa: E402
from cospeech.motion.poses.keypoints2d import (  # noqa: E402
    KEYPOINTS2D,
    points_of,
    to_points,
)
from tests.experiments.test_style_mixing import swinging  # noqa: E402

WAYS = {"ann": (0.5, 0.6, 0.0), "bob": (1.0, 0.0, 0.6), "cleo": (0.7, 0.3, 0.3)}  # hertz, swing of the right and left arm
FRAMES, FPS = 330, 15.0


class Puppet(Windowed):
    """Plays the recorded windows of the style; if it ``hears``, those of the speaker, whom the first column of audio names."""

    pose, audio, multiple, shortest, styles, modes = 96, 3, 32, 64, 3, 0

    def __init__(self, windows: torch.Tensor, *, hears: bool) -> None:
        super().__init__()
        self.windows, self.hears = torch.nn.Parameter(windows), hears

    def make(self, audio: torch.Tensor, style: torch.Tensor, mode_noise: torch.Tensor) -> torch.Tensor:
        who = audio[:, 0, 0].round().long() if self.hears else style[:, 0].argmax(-1)
        loud = 1 + 0.1 * audio[:, :1, 1:2]
        return self.windows[who][:, : audio.shape[1]] * loud

    def speaker_styles(self, stretches: torch.Tensor) -> torch.Tensor:
        return torch.eye(len(stretches))


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Three speakers with a way of their own; each frame of speech says who speaks, and how loud."""
    pieces = []
    for number, (name, way) in enumerate(WAYS.items()):
        for split in ("train", "test"):
            motion = swinging(*way, FRAMES / FPS, phase=0.3)
            pose = KEYPOINTS2D.encode(points_of(motion.resample(FPS)))[:FRAMES].astype(np.float32)
            loud = np.random.default_rng(number).normal(size=(FRAMES, 2))
            audio = np.concatenate([np.full((FRAMES, 1), number), loud], 1).astype(np.float32)
            values = {"pose": pose, "audio": audio}
            entry = Entry(f"{name}-{split}", name, split, 0, FRAMES, 0.0, tuple(values))
            pieces.append(Piece(entry, (), lambda values=values: dict(values)))
    folder: Path = tmp_path_factory.mktemp("store") / "store"
    names = {"pose": KEYPOINTS2D.names, "audio": ("who", "loud", "other")}
    write_store(folder, pieces, corpus="pats", pose="keypoints2d", fps=FPS, names=names)
    return Store(folder)


def player_of(store: Store, *, hears: bool) -> PlayableRun:
    mean, std = store.statistics("pose")
    std = np.maximum(std, 1.0)
    stretches = np.stack([(store.clip(f"{name}-train")["pose"][None, :128] - mean) / std for name in WAYS])
    net = Puppet(torch.from_numpy(stretches[:, 0].astype(np.float32)), hears=hears)
    statistics = {"pose_mean": mean, "pose_std": std, "audio_mean": np.zeros(3), "audio_std": np.ones(3)}
    facts = {"recipe": {"data": {}}, "store": {"speakers": list(WAYS)}}
    return PlayableRun(net, facts, statistics, "fingerprint", stretches)


def test_windows_are_of_the_speakers_test_clips_and_do_not_overlap(store):
    starts = heatmaps.windows_of(store, "bob", 99, seed=0)
    clip = next(c for c in store.clips if c.name == "bob-test")
    assert len(starts) == FRAMES // heatmaps.FRAMES
    assert (np.diff(starts) >= heatmaps.FRAMES).all()
    assert starts.min() >= clip.offset
    assert starts.max() + heatmaps.FRAMES <= clip.offset + clip.frames
    assert len(heatmaps.windows_of(store, "bob", 2, seed=0)) == 2
    with pytest.raises(InputError, match="no test clip of 'dora'"):
        heatmaps.windows_of(store, "dora", 2, seed=0)


def test_a_network_that_plays_styles_keeps_them_whoever_speaks(store):
    space = spaces.gesture_space(player_of(store, hears=False), store)
    assert space.hits() == (1.0, 1.0)
    assert space.preserved.shape == (15, 192)  # five windows of each of three, mean and deviation of 96 numbers
    assert space.transferred.shape == space.preserved.shape
    assert sorted(set(space.transferred_styles)) == sorted(WAYS)


def test_a_network_that_is_deaf_to_style_is_found_out(store):
    space = spaces.gesture_space(player_of(store, hears=True), store)
    assert space.hits() == (1.0, 0.0)


def test_points_are_mean_and_deviation_of_what_was_made(store):
    player = player_of(store, hears=False)
    space = spaces.gesture_space(player, store, ("bob", "ann"))
    assert space.preserved_styles == ("bob",) * 5 + ("ann",) * 5
    start = int(heatmaps.windows_of(store, "bob", 99, seed=0)[0])
    loud = 1 + 0.1 * float(store.arrays["audio"][start, 1])
    poses = player.stretches[1, 0, : heatmaps.FRAMES] * loud
    np.testing.assert_allclose(space.preserved[0], np.concatenate([poses.mean(0), poses.std(0)]), atol=1e-4)


def test_both_panels_lie_in_one_plane(store, monkeypatch):
    all_panels = []
    monkeypatch.setattr(spaces, "draw_map", lambda panels: all_panels.extend(panels) or np.zeros((2, 2, 3), np.uint8))
    spaces.draw_gesture_space(player_of(store, hears=False), store)
    left, right = all_panels
    np.testing.assert_array_equal(left.behind, right.points)
    np.testing.assert_array_equal(right.behind, left.points)
    assert "100%" in left.text
    picture = draw_map([left])
    assert picture.shape[2] == 3
    assert (draw_map([Panel(left.title, left.text, left.points, left.groups)]) != picture).any()


@pytest.mark.parametrize("speakers", [("ann",), ("ann", "dora"), ("ann", "ann")])
def test_gesture_spaces_are_of_two_known_speakers(store, speakers):
    with pytest.raises(InputError):
        spaces.gesture_space(player_of(store, hears=False), store, speakers)


def test_columns_of_heat_maps_are_styles_and_rows_voices(store, monkeypatch):
    drawing = {}

    def draw(cells, figure, fps, **labels):
        drawing.update(labels, cells=cells, fps=fps)
        return heatmaps_draw(cells, figure, fps, **labels)

    heatmaps_draw = heatmaps.draw_heat
    monkeypatch.setattr(heatmaps, "draw_heat", draw)
    player = player_of(store, hears=False)
    picture = heatmaps.draw_heatmaps(player, store, ("cleo", "ann"), ("bob", "cleo", "ann"))
    assert picture.dtype == np.uint8
    assert drawing["columns"] == ["cleo", "ann"]
    assert len(drawing["rows"]) == len(drawing["cells"]) == 4
    assert ["bob" in row for row in drawing["rows"]] == [False, True, False, False]
    start = int(heatmaps.windows_of(store, "ann", 99, seed=0)[0])
    np.testing.assert_allclose(drawing["cells"][0][1][0], to_points(store.arrays["pose"][start : start + 64]), atol=1e-3)
    starts = heatmaps.windows_of(store, "bob", 99, seed=0)
    loud = 1 + 0.1 * float(store.arrays["audio"][starts[2], 1])
    expected = to_points(player.unpose(player.stretches[2, 0, :64] * loud))
    np.testing.assert_allclose(drawing["cells"][1][0][2], expected, atol=0.01)
    with pytest.raises(InputError, match="no style"):
        heatmaps.draw_heatmaps(player, store, ("dora",))


def test_recordings_are_drawn_by_speaker(store):
    one = heatmaps.draw_recordings(store, ("ann", "bob"), rows=1)
    np.testing.assert_array_equal(one, heatmaps.draw_recordings(store, ("ann", "bob"), rows=1))
    assert heatmaps.draw_recordings(store, rows=2, title="three").shape[0] > one.shape[0]
    with pytest.raises(InputError, match="no clip of 'dora'"):
        heatmaps.draw_recordings(store, ("dora",))
