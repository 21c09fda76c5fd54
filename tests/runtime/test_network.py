"""The engine of networks: what is asked of it and what it refuses; takes alone and together; memory; whatever goes in."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.errors import InputError
from cospeech.runtime.bundles.signature import STYLE_FRAMES, Signature
from cospeech.runtime.network import LIMIT, Network
from tests.support.runtime_bundles import (
    MODES,
    MULTIPLE,
    NAMES,
    NOISE,
    REACH,
    REACH_OF_VOICE,
    WORDS,
    Graph,
    small_chain,
    small_windows,
)

POSE, AUDIO = 5, 7
KINDS = {"window": small_windows, "chain": small_chain}
EACH = [("window", "make"), ("chain", "make"), ("chain", "live")]
each_player = pytest.mark.parametrize(("kind", "name"), EACH)


@cache
def network(kind: str, name: str, edge: float = 1e3, **options) -> Network:
    signatures, weights, graphs = KINDS[kind](POSE, AUDIO, **options)
    return Network(signatures[name], graphs[name], weights, {"poses": (np.full(POSE, -edge), np.full(POSE, edge))})


def material(who: Network, takes: int, frames: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Frames of everything that a network takes."""
    rng = np.random.default_rng(seed)
    shapes = {name: (1 if port[0] == 1 else takes, frames, port[-1]) for name, port in who.signature.inputs.items()}
    return {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}


def play(who: Network, given: dict[str, np.ndarray]) -> np.ndarray:
    """(N, T, D) at once, or frame by frame."""
    if who.signature.window is not None:
        return who.run(**given)["poses"]
    state, poses = who.begin(len(given["style"])), []
    for k in range(given["rows"].shape[1]):
        output = who.run(**{name: x[:, k] for name, x in given.items()}, **state)
        state = {name: output[f"next.{name}"] for name in state}
        poses.append(output["poses"])
    return np.stack(poses, 1)


def alone(given: dict[str, np.ndarray], take: int) -> dict[str, np.ndarray]:
    return {name: x if name == "rows" else x[take : take + 1] for name, x in given.items()}


@each_player
@pytest.mark.parametrize("without", [{}, {"noise": 0}, {"words": 0}, {"judges": False}], ids=str)
def test_takes_together_have_the_bits_of_takes_alone(kind, name, without):
    who = network(kind, name, **(without if kind == "chain" else {}))
    given = material(who, 4, 24)
    whole = play(who, given)
    assert whole.shape == (4, 24, POSE)
    assert whole.dtype == np.float32
    for k in range(4):
        if name == "live" or kind == "chain":
            assert play(who, alone(given, k)).tobytes() == whole[k].tobytes()
        np.testing.assert_allclose(play(who, alone(given, k))[0], whole[k], atol=1e-5)
    assert np.abs(whole[0] - whole[1]).max() > 1e-3
    assert play(who, given).tobytes() == whole.tobytes()


@each_player
def test_everything_that_is_given_matters(kind, name):
    who = network(kind, name)
    given = material(who, 1, 20)
    poses = play(who, given)
    parts = [(port, slice(None)) for port in given]
    parts += [("rows", slice(AUDIO)), ("rows", slice(AUDIO, None)), ("style", slice(2)), ("style", slice(2, None))] * (
        kind == "chain"
    )
    for port, part in parts:
        other = given[port].copy()
        other[..., part] = given[port][..., part][..., ::-1]
        assert np.abs(play(who, given | {port: other}) - poses).max() > 1e-3
        without = {key: x for key, x in given.items() if key != port}
        if port != "rows" and name == "make":  # what is left out is zeros
            zeros = np.zeros_like(given[port])
            assert play(who, without).tobytes() == play(who, given | {port: zeros}).tobytes()


def measure_change(frame: int, frames: int, at: int) -> float:
    """How much a frame of poses changes when a frame of speech changes."""
    given = material(network("window", "make"), 1, frames)
    other = given["rows"].copy()
    other[0, at] += 3
    poses = [play(network("window", "make"), given | {"rows": rows}) for rows in (given["rows"], other)]
    return float(np.abs(poses[1] - poses[0])[0, frame].max())


def test_speech_matters_within_the_reach_and_not_beyond():
    frames = 4 * REACH // MULTIPLE * MULTIPLE
    middle = frames // 2 // MULTIPLE * MULTIPLE
    near = []
    for frame in range(middle, middle + MULTIPLE):  # every place on the grid of halvings
        for side in (-1, 1):
            assert measure_change(frame, frames, frame + side * (REACH + 1)) == 0
            assert measure_change(frame, frames, frame + side * (2 * REACH - 2)) == 0
            near.append(measure_change(frame, frames, frame + side * REACH))
    assert max(near) > 0


def test_within_the_reach_of_silence_a_window_is_the_whole_speech():
    """A window with as many frames around as the reach, on the grid, makes what the whole speech makes."""
    who = network("window", "make")
    given = material(who, 2, 160)
    whole, margin = play(who, given), -(-REACH // MULTIPLE) * MULTIPLE
    piece = slice(60 - margin, 100 + margin)
    poses = play(who, {name: x[:, piece] for name, x in given.items()})
    np.testing.assert_allclose(poses[:, margin:-margin], whole[:, 60:100], atol=1e-5)
    assert np.abs(poses[:, : margin // 2] - whole[:, piece][:, : margin // 2]).max() > 1e-3


def test_noise_draws_a_mode():
    """With a logit far above the others, the mixture is that mode alone: it is the corner of what mixtures can be."""
    who = network("window", "make")
    given = material(who, 1, 32)
    pure = [play(who, given | {"noise": np.eye(MODES)[None, [m] * 32] * LIMIT}) for m in range(MODES)]
    low, high = np.min(pure, 0), np.max(pure, 0)
    mixture = play(who, given | {"noise": np.zeros((1, 32, MODES))})
    assert ((low - 1e-4 <= mixture) & (mixture <= high + 1e-4)).all()
    assert (high - low).mean() > 0.05


def test_a_frame_hears_nothing_that_comes_later_and_remembers_what_came_before():
    who = network("chain", "live")
    given = material(who, 2, 30)
    poses, later, before = play(who, given), given["rows"].copy(), given["rows"].copy()
    later[:, 20:], before[:, 5] = 9, 9
    assert play(who, given | {"rows": later})[:, :20].tobytes() == poses[:, :20].tobytes()
    change = np.abs(play(who, given | {"rows": before}) - poses).max((0, 2))
    assert not change[:5].any()
    assert (change[5:15] > 0).all()  # by its memory longer than by the rows it sees
    one = who.run(**{name: x[:, 0] for name, x in given.items()}, **who.begin(2))  # sessions share nothing
    assert one["poses"].tobytes() == poses[:, 0].tobytes()


def test_logits_are_of_their_frame_and_those_around_it():
    who = network("chain", "classify")
    rows = np.random.default_rng(0).normal(size=(1, 40, AUDIO)).astype(np.float32)
    whole, other = who.run(rows=rows)["logits"][0], rows.copy()
    for k in (5, 12, 35):
        piece = rows[:, k - REACH_OF_VOICE : k + REACH_OF_VOICE + 1]
        np.testing.assert_allclose(who.run(rows=piece)["logits"][0, REACH_OF_VOICE], whole[k], atol=1e-5)
    other[0, 20] += 1
    frames = np.flatnonzero(np.abs(who.run(rows=other)["logits"][0] - whole).max(1) > 1e-6)
    assert (frames[0], frames[-1]) == (20 - REACH_OF_VOICE, 20 + REACH_OF_VOICE)


def test_styles_are_shares():
    who, poses = network("window", "style"), np.random.default_rng(0).normal(size=(1, 90, POSE))
    style = who.run(poses=poses)["style"]
    assert style.shape == (1, len(NAMES))
    assert style.sum() == pytest.approx(1)
    assert np.abs(style - who.run(poses=3 * poses)["style"]).max() > 1e-3
    assert who.signature.window == STYLE_FRAMES


@pytest.mark.parametrize(("kind", "name"), [*EACH, ("window", "style"), ("chain", "classify")])
def test_numbers_lie_within_the_bounds_whatever_goes_in(kind, name):
    who, rng = network(kind, name, 0.25), np.random.default_rng(0)
    output = next(iter(who.signature.outputs))
    for size in (1.0, 1e6, 1e30, 3e38):
        given = {key: (size * rng.normal(size=x.shape)).clip(-3e38, 3e38) for key, x in material(who, 2, 64).items()}
        values = play(who, given) if output == "poses" else who.run(**given)[output]
        assert np.abs(values).max() <= (0.25 if output == "poses" else LIMIT)
    given = material(who, 1, 64)
    loud = {key: np.where(np.abs(x) > 1, np.sign(x) * 1e30, x) for key, x in given.items()}
    within_limits = {key: np.clip(x, -LIMIT, LIMIT) for key, x in loud.items()}
    if output == "poses":
        assert play(who, loud).tobytes() == play(who, within_limits).tobytes()


WRONG = {
    ("window", "make"): [
        {"rows": (1, 32, AUDIO + 1)}, {"rows": (32, AUDIO)}, {"rows": (1, 30, AUDIO)}, {"rows": (1, 0, AUDIO)},
        {"rows": (2, 32, AUDIO)}, {"style": (2, 32, 5)}, {"style": (2, 28, 2)}, {"style": (0, 32, 2)}, {"style": (3, 32, 2)},
        {"noise": (1, 32, MODES)}, {"noise": (2, 32, 0)}, {"words": (1, 32, 3)},
    ],
    ("chain", "live"): [
        {"rows": (1, AUDIO + WORDS + 1)}, {"rows": (1, 1, AUDIO + WORDS)}, {"rows": (0,)}, {"style": (2, 3)},
        {"style": (1, 10)},
        {"style": (10,)}, {"noise": (2, NOISE + 1)}, {"noise": (2,)}, {"noise": (2, 0)}, {"state0": (2, 20)},
        {"state1": (1, 8)},
        {"face": (1, 53)},
    ],
    ("window", "style"): [{"poses": (1, 64, POSE + 1)}, {"poses": (64,)}, {"poses": (64, POSE)}, {"poses": (2, 64, POSE)}],
    ("chain", "classify"): [
        {"rows": (1, 0, AUDIO)}, {"rows": (1, 9, AUDIO + WORDS)}, {"rows": (9,)}, {"rows": (9, AUDIO)},
    ],
}  # fmt: skip


@pytest.mark.parametrize(("who", "wrong"), [(who, wrong) for who, cases in WRONG.items() for wrong in cases], ids=str)
def test_shapes(who, wrong):
    player = network(*who)
    given = material(player, 2, 32)
    if who[1] == "live":
        given = {name: x[:, 0] for name, x in given.items()} | player.begin(2)
    with pytest.raises(InputError, match="a network"):
        player.run(**given | {name: np.zeros(shape) for name, shape in wrong.items()})


def test_takes_of_a_network_without_style_and_noise_are_one():
    weights: dict[str, np.ndarray] = {}
    b = Graph("make", weights)
    b.poses(b.node("Conv", b.wave("rows"), b.random(POSE, AUDIO, 3), pads=[1, 1]))
    signature = Signature({"rows": (1, "T", AUDIO)}, {"poses": (1, "T", POSE)}, window=8, reach=1)
    who = Network(signature, b.model(signature), weights)
    rows = np.random.default_rng(1).normal(size=(11, AUDIO)).astype(np.float32)
    padded, weight = np.pad(rows, ((1, 1), (0, 0))), weights["make.0"]
    expected = sum(padded[k : k + 11] @ weight[:, :, k].T for k in range(3))
    np.testing.assert_allclose(who.run(rows=rows[None])["poses"], expected[None], atol=1e-5)


@pytest.mark.parametrize("field", ["window", "multiple", "reach", "hop", "look_ahead", "seeds"])
@pytest.mark.parametrize("value", [-1, 1.0, "1", True, 1 << 40])
def test_sizes_are_sane(field, value):
    plain = {"inputs": {"rows": (1, "T", AUDIO)}, "outputs": {"poses": (1, "T", POSE)}, "window": 16}
    with pytest.raises(InputError, match=field):
        Signature(**{**plain, field: value})


def test_a_signature_survives_a_manifest():
    for kind, build in KINDS.items():
        for name, signature in build(POSE, AUDIO)[0].items():
            assert Signature.parse(name, signature.to_dict()) == signature, kind
    with pytest.raises(InputError, match="a state"):
        Signature({"rows": (1, AUDIO)}, {"poses": ("N", POSE)}, {"state0": ("N", 3)}, window=16)
