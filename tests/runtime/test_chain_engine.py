"""The engine of chains: what is asked of it and what it refuses; takes alone and together; its memory; whatever goes in."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.errors import InputError
from cospeech.runtime.chain_engine import ChainEngine
from cospeech.runtime.window_engine import LIMIT
from tests.support.chain_bundles import LOOK_AHEAD, NAMES, NOISE, REACH, WORDS, small_chain

POSE, AUDIO = 5, 7
STYLE = len(NAMES) + 8


@cache
def engine(bound: float = 1e3, **kind) -> ChainEngine:
    return ChainEngine(*small_chain(POSE, AUDIO, **kind), np.full(POSE, -bound), np.full(POSE, bound))


def material(takes: int, frames: int, seed: int = 0, noise: int = NOISE, words: int = WORDS) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    shapes = (frames, AUDIO + words), (takes, frames, STYLE), (takes, frames, noise)
    return [rng.normal(size=shape).astype(np.float32) for shape in shapes]


def lived(who: ChainEngine, rows, style, noise) -> np.ndarray:
    """(N, T, D) frame by frame."""
    live = who.live(len(style))
    return np.stack([live.frame(rows[k], style[:, k], noise[:, k]) for k in range(len(rows))], 1)


@pytest.mark.parametrize("kind", [{}, {"noise": 0}, {"words": 0}, {"judges": False}], ids=str)
def test_takes_together_have_the_bits_of_takes_alone(kind):
    who, sizes = engine(**kind), engine(**kind).sizes
    rows, style, noise = material(4, 23, noise=sizes.noise, words=sizes.words)
    for play in (who.windows.make, lambda *given: lived(who, *given)):
        whole = play(rows, style, noise)
        assert whole.shape == (4, 23, POSE)
        assert whole.dtype == np.float32
        for k in range(4):
            assert play(rows, style[k : k + 1], noise[k : k + 1]).tobytes() == whole[k].tobytes()
        assert np.abs(whole[0] - whole[1]).max() > 1e-3


def test_everything_that_is_given_matters():
    rows, style, noise = material(1, 20)
    for play in (engine().windows.make, lambda *given: lived(engine(), *given)):
        made = play(rows, style, noise)
        for k, given in enumerate((rows, rows, style, style, noise)):
            other = [rows.copy(), style.copy(), noise.copy()]
            which = (0, 0, 1, 1, 2)[k]
            part = (slice(AUDIO), slice(AUDIO, None), slice(2), slice(2, None), slice(None))[k]
            other[which][..., part] = given[..., part][..., ::-1]
            assert np.abs(play(*other) - made).max() > 1e-3


def test_a_frame_hears_nothing_that_comes_later_and_remembers_what_came_before():
    rows, style, noise = material(2, 30)
    made, later, before = lived(engine(), rows, style, noise), rows.copy(), rows.copy()
    later[20:], before[5] = 9, 9
    assert lived(engine(), later, style, noise)[:, :20].tobytes() == made[:, :20].tobytes()
    moved = np.abs(lived(engine(), before, style, noise) - made).max((0, 2))
    assert not moved[:5].any()
    assert (moved[5:15] > 0).all()  # by its LSTM longer than by its convolution
    one, other = engine().live(2), engine().live(2)  # performances share nothing
    one.frame(later[25], style[:, 0], noise[:, 0])
    assert other.frame(rows[0], style[:, 0], noise[:, 0]).tobytes() == made[:, 0].tobytes()


def test_logits_are_of_their_frame_and_those_around_it():
    rows = np.random.default_rng(0).normal(size=(40, AUDIO)).astype(np.float32)
    whole = engine().classify(rows)
    assert whole.shape == (40 - 2 * REACH, STYLE)
    for k in (0, 7, 35):
        np.testing.assert_allclose(engine().classify(rows[k : k + 2 * REACH + 1])[0], whole[k], atol=1e-5)
    other = rows.copy()
    other[20] += 1
    moved = np.flatnonzero(np.abs(engine().classify(other) - whole).max(1) > 1e-6)
    assert (moved[0], moved[-1]) == (20 - 2 * REACH, 20)


def test_numbers_lie_within_the_bounds_whatever_goes_in():
    small, rng = engine(0.25), np.random.default_rng(0)
    for size in (1.0, 1e6, 1e30, 3e38):
        rows, style, noise = ((size * rng.normal(size=x.shape)).clip(-3e38, 3e38) for x in material(2, 24))
        for made in (small.windows.make(rows, style, noise), lived(small, rows, style, noise)):
            assert np.abs(made).max() <= 0.25
        assert np.abs(small.classify(rows[:, :AUDIO])).max() <= LIMIT
    rows, style, noise = material(1, 12)
    loud = [np.where(np.abs(x) > 1, np.sign(x) * 1e30, x) for x in (rows, style, noise)]
    clipped = [np.clip(x, -LIMIT, LIMIT) for x in loud]
    assert lived(engine(), *loud).tobytes() == lived(engine(), *clipped).tobytes()


@pytest.mark.parametrize(
    "wrong",
    [(0, (AUDIO + WORDS + 1,)), (0, (1, AUDIO + WORDS)), (0, (0,)), (1, (2, STYLE + 1)), (1, (1, STYLE)), (1, (STYLE,)),
     (2, (2, NOISE + 1)), (2, (2,)), (2, (2, 0))],
    ids=str,
)  # fmt: skip
def test_shapes_of_frames(wrong):
    given = [np.zeros(AUDIO + WORDS), np.zeros((2, STYLE)), np.zeros((2, NOISE))]
    given[wrong[0]] = np.zeros(wrong[1])
    with pytest.raises(InputError):
        engine().live(2).frame(*given)


@pytest.mark.parametrize("shape", [(2 * REACH, AUDIO), (0, AUDIO), (9, AUDIO + WORDS), (9,), (1, 9, AUDIO)])
def test_shapes_to_judge(shape):
    with pytest.raises(InputError):
        engine().classify(np.zeros(shape))


def test_what_it_cannot_do_is_told():
    assert (engine().adversarial, engine().lives) == (True, True)
    assert (engine(adversarial=False).adversarial, engine(live=False).lives) == (False, False)
    with pytest.raises(InputError, match="frame by frame"):
        engine(live=False).live(1)
    with pytest.raises(InputError, match="classifier"):
        engine(adversarial=False).classify(np.zeros((9, AUDIO)))


def test_bounds_graphs_and_weights_that_are_none():
    sizes, weights, graphs = small_chain(POSE, AUDIO)
    low, high = np.full(POSE, -1.0), np.full(POSE, 1.0)
    for bounds in ((high, low), (low[1:], high[1:]), (low, low), (low * np.nan, high)):
        with pytest.raises(InputError):
            ChainEngine(sizes, weights, graphs, *bounds)
    others = ({}, {"make": graphs["make"]}, {**graphs, "style": graphs["make"]}, {**graphs, "live": graphs["make"]},
              {**graphs, "make": graphs["live"]}, {**graphs, "classify": graphs["make"]})  # fmt: skip
    for wrong in others:
        with pytest.raises(InputError):
            ChainEngine(sizes, weights, wrong, low, high)
    with pytest.raises(InputError, match="no graph has"):
        ChainEngine(sizes, {**weights, "odd": np.zeros(3, np.float32)}, graphs, low, high)


@pytest.mark.parametrize("field", ["pose", "audio", "words", "speakers", "noise", "window", "reach", "look_ahead"])
@pytest.mark.parametrize("value", [-1, 1.0, "1", True, None, 1 << 40])
def test_sizes_are_sane(field, value):
    with pytest.raises(InputError, match=field):
        replace(engine().sizes, **{field: value})


@pytest.mark.parametrize("change", [{"pose": POSE + 1}, {"audio": AUDIO - 1}, {"words": WORDS + 1}, {"speakers": 3},
                                    {"noise": 0}, {"noise": 5}, {"look_ahead": 0}], ids=str)  # fmt: skip
def test_sizes_of_another_network(change):
    sizes, weights, graphs = small_chain(POSE, AUDIO)
    with pytest.raises(InputError):
        ChainEngine(replace(sizes, **change), weights, graphs, np.full(POSE, -1.0), np.full(POSE, 1.0))


def test_sizes_tell_widths():
    sizes = engine().sizes
    assert (sizes.rows, sizes.style, sizes.look_ahead) == (AUDIO + WORDS, STYLE, LOOK_AHEAD)
    assert (sizes.windows.audio, sizes.windows.styles, sizes.windows.reach) == (AUDIO + WORDS, STYLE, None)
