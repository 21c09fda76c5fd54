"""The engine of window networks: what is asked of it and what it refuses; how far it hears; its numbers, whatever goes in."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.errors import InputError
from cospeech.runtime.window_engine import LIMIT, STYLE_FRAMES, WindowEngine, WindowSizes
from tests.support.window_bundles import MODES, MULTIPLE, NAMES, REACH, small_network

POSE, AUDIO = 5, 7


@cache
def engine(edge: float = 100.0) -> WindowEngine:
    sizes, weights, graphs = small_network(POSE, AUDIO)
    return WindowEngine(sizes, weights, graphs, np.full(POSE, -edge), np.full(POSE, edge))


def material(takes: int, frames: int, seed: int = 0) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    shapes = (frames, AUDIO), (takes, frames, len(NAMES)), (takes, frames, MODES)
    return [rng.normal(size=shape).astype(np.float32) for shape in shapes]


def moved(frame: int, frames: int, at: int) -> float:
    """How far a frame of poses moves when another one of speech does."""
    rows, style, mode_noise = material(1, frames)
    other = rows.copy()
    other[at] += 3
    return float(np.abs(engine().make(rows, style, mode_noise) - engine().make(other, style, mode_noise))[0, frame].max())


def test_speech_matters_within_the_reach_and_not_beyond():
    assert engine().sizes.reach == REACH
    frames = 4 * REACH // MULTIPLE * MULTIPLE
    middle = frames // 2 // MULTIPLE * MULTIPLE
    near = []
    for frame in range(middle, middle + MULTIPLE):  # every place on the grid of halvings
        for side in (-1, 1):
            assert moved(frame, frames, frame + side * (REACH + 1)) == 0
            assert moved(frame, frames, frame + side * (2 * REACH - 2)) == 0
            near.append(moved(frame, frames, frame + side * REACH))
    assert max(near) > 0


def test_within_the_reach_of_silence_a_window_is_the_whole_speech():
    """A window with as many frames around as the reach, on the grid, makes what the whole speech makes."""
    rows, style, mode_noise = material(2, 160)
    whole = engine().make(rows, style, mode_noise)
    margin = -(-REACH // MULTIPLE) * MULTIPLE
    piece = slice(60 - margin, 100 + margin)
    made = engine().make(rows[piece], style[:, piece], mode_noise[:, piece])
    np.testing.assert_allclose(made[:, margin:-margin], whole[:, 60:100], atol=1e-5)
    assert np.abs(made[:, : margin // 2] - whole[:, piece][:, : margin // 2]).max() > 1e-3


def test_takes_share_the_speech_and_nothing_else():
    rows, style, mode_noise = material(3, 32)
    together = engine().make(rows, style, mode_noise)
    assert together.shape == (3, 32, POSE)
    assert together.dtype == np.float32
    for n in range(3):
        np.testing.assert_allclose(engine().make(rows, style[n : n + 1], mode_noise[n : n + 1])[0], together[n], atol=1e-5)
    assert np.abs(together[0] - together[1]).max() > 0.01


def test_the_same_in_the_same_out():
    inputs = material(2, 64)
    assert engine().make(*inputs).tobytes() == engine().make(*inputs).tobytes()


def test_mode_noise_draws_a_mode():
    """With a logit far above the others, the mixture is that mode alone: it is the corner of what mixtures can be."""
    rows, style, _ = material(1, 32)
    alone = [engine().make(rows, style, np.eye(MODES)[None, [m] * 32] * LIMIT) for m in range(MODES)]
    low, high = np.min(alone, 0), np.max(alone, 0)
    mixed = engine().make(rows, style, np.zeros((1, 32, MODES)))
    assert ((low - 1e-4 <= mixed) & (mixed <= high + 1e-4)).all()
    assert (high - low).mean() > 0.05


def test_poses_lie_within_the_bounds_whatever_goes_in():
    small = engine(0.25)
    rng = np.random.default_rng(0)
    for size in (1.0, 1e6, 1e30, 3e38):
        rows, style, mode_noise = ((size * rng.normal(size=x.shape)).clip(-3e38, 3e38) for x in material(2, 32))
        made = small.make(rows, style, mode_noise)
        assert np.abs(made).max() <= 0.25
        assert np.isfinite(small.style_of(size * rng.normal(size=(STYLE_FRAMES, POSE)))).all()


def test_styles_are_shares():
    poses = np.random.default_rng(0).normal(size=(90, POSE))
    style = engine().style_of(poses)
    assert style.shape == (len(NAMES),)
    assert style.sum() == pytest.approx(1)
    assert np.abs(style - engine().style_of(3 * poses)).max() > 1e-3


@pytest.mark.parametrize(
    "wrong",
    [
        (0, (32, AUDIO + 1)), (0, (32,)), (0, (30, AUDIO)), (0, (0, AUDIO)), (1, (2, 32, 5)), (1, (2, 28, 2)), (1, (0, 32, 2)),
        (2, (1, 32, MODES)), (2, (2, 32, 0)),
    ],
    ids=str,
)  # fmt: skip
def test_shapes(wrong):
    inputs = material(2, 32)
    inputs[wrong[0]] = np.zeros(wrong[1])
    with pytest.raises(InputError):
        engine().make(*inputs)


@pytest.mark.parametrize("shape", [(63, POSE), (64, POSE + 1), (64,), (1, 64, POSE)])
def test_shapes_of_examples(shape):
    with pytest.raises(InputError):
        engine().style_of(np.zeros(shape))


def test_bounds_and_graphs_that_are_none():
    sizes, weights, graphs = small_network(POSE, AUDIO)
    low, high = np.full(POSE, -1.0), np.full(POSE, 1.0)
    for bounds in ((high, low), (low[1:], high[1:]), (low, low), (low * np.nan, high)):
        with pytest.raises(InputError):
            WindowEngine(sizes, weights, graphs, *bounds)
    with pytest.raises(InputError):
        WindowEngine(sizes, weights, {}, low, high)


def test_a_network_without_style_and_modes_makes_takes_that_are_alike():
    from cospeech.training.export.conv_graph import ConvGraph

    weights: dict[str, np.ndarray] = {}
    b = ConvGraph(weights, "make", 1)
    made = b.conv(b.rows("rows", AUDIO), np.random.default_rng(0).normal(size=(POSE, AUDIO, 1, 3)), None, pads=(0, 1, 0, 1))
    b.as_rows(made, "poses")
    graph = b.serialise({"rows": (1, "T", AUDIO)}, {"poses": (1, "T", POSE)})
    sizes = WindowSizes(pose=POSE, audio=AUDIO, styles=0, modes=0, window=8, multiple=1, reach=int(made.reach))
    alone = WindowEngine(sizes, weights, {"make": graph}, np.full(POSE, -99.0), np.full(POSE, 99.0))
    rows = np.random.default_rng(1).normal(size=(11, AUDIO)).astype(np.float32)
    takes = alone.make(rows, np.zeros((3, 11, 0)), np.zeros((3, 11, 0)))
    padded, weight = np.pad(rows, ((1, 1), (0, 0))), weights["make.0"][:, :, 0]
    wanted = sum(padded[k : k + 11] @ weight[:, :, k].T for k in range(3))
    np.testing.assert_allclose(takes, np.stack([wanted] * 3), atol=1e-5)
    takes[0] += 1  # nobody's but the caller's
    assert sizes.reach == 1
    assert alone.style_of(np.zeros((64, POSE))) is None


@pytest.mark.parametrize("field", ["pose", "audio", "styles", "modes", "window", "multiple", "reach"])
@pytest.mark.parametrize("value", [-1, 1.0, "1", True, 1 << 40])
def test_sizes_are_sane(field, value):
    with pytest.raises(InputError, match=field):
        WindowSizes(**{**vars(engine().sizes), field: value})
