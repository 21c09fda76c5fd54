"""The engine against the network that it was made from; takes, pieces, precision, and what a hostile network can do."""

from __future__ import annotations

from dataclasses import asdict, fields, replace
from functools import cache

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.runtime.flow.engine import FlowEngine, StudentT
from cospeech.runtime.flow.graph import build_graphs
from cospeech.runtime.flow.weights import FlowSizes, pack_weights, unpack
from cospeech.runtime.network import run_session

torch = pytest.importorskip("torch")

from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.models.stylised_flow import FlowConfig, StylisedFlow  # noqa: E402
from cospeech.models.stylised_flow_extended import FlowExtendedConfig, StylisedFlowExtended  # noqa: E402

POSE, AUDIO = 7, 3
TINY = FlowExtendedConfig(
    steps=3, hidden=12, layers=2, history=5, look_ahead=2, frames=4, feature=6, encoder_channels=8, encoder_blocks=2
)  # fmt: skip


def lively(model: torch.nn.Module, strength: float = 1.0) -> torch.nn.Module:
    """Random weights where the network begins with zeros, so that every part has a say."""
    generator = torch.Generator().manual_seed(3)
    with torch.no_grad():
        for name, value in model.state_dict().items():
            if "net.out" in name or ("norm" in name and value.is_floating_point()):
                value.copy_(0.3 * strength * torch.randn(value.shape, generator=generator))
            if name.endswith("running_var") or ("encoder" in name and name.endswith("norm.weight")):
                value.copy_(0.5 + torch.rand(value.shape, generator=generator))
    return model.eval()


def sizes_of(config: FlowExtendedConfig, *, int8: bool) -> FlowSizes:
    with torch.device("meta"):
        return FlowSizes(**StylisedFlowExtended(config, pose=POSE, audio=AUDIO).runtime_sizes(), int8=int8)


def engine_of(arrays: dict[str, np.ndarray], sizes: FlowSizes, bound: float = 50.0) -> FlowEngine:
    weights = pack_weights(arrays, sizes)
    edge = np.full(sizes.pose, bound)
    return FlowEngine(sizes, weights, build_graphs(weights, sizes), -edge, edge)


@cache
def network(**changes: object) -> StylisedFlowExtended:
    torch.manual_seed(0)
    return lively(StylisedFlowExtended(replace(TINY, **changes), pose=POSE, audio=AUDIO))


def speech(frames: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(frames, AUDIO)).astype(np.float32)


def histories(takes: int, tau: int = TINY.history) -> np.ndarray:
    return np.random.default_rng(2).normal(size=(takes, tau, POSE)).astype(np.float32)


def latents(takes: int, frames: int, seed: int = 4) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(takes, frames, POSE)).astype(np.float32)


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"encoder": False},
        {"encoder_oldest": True},
        {"encoder_relu": False},
        {"layers": 1, "look_ahead": 0},
        {"layers": 3, "steps": 1},
        {"residual": True},
        {"residual": True, "inertia": 0.3},
        {"residual": True, "inertia": 0.4, "steps_seen": True},
        {"steps_seen": True},
        {"style": 4},
        {"style": 3, "encoder": False},
    ],
    ids=lambda c: ",".join(c) or "default",
)
def test_float_engine_is_the_network(changes):
    model = network(**changes)
    engine = engine_of(model.export(), sizes_of(model.config, int8=False))
    audio, past, z = speech(20 + model.speech_frames), histories(2), latents(2, 21)
    examples = histories(2, 19)
    styles = np.stack([engine.style_code(poses) for poses in examples]) if engine.sizes.style else None
    result = engine.begin(past, styles).frames(engine.windows(audio), z)
    with torch.no_grad():
        code = model.style(torch.from_numpy(examples))
        expected = model.sample(*(torch.from_numpy(v) for v in (z, past, np.stack([audio] * 2))), code).numpy()
    if styles is not None:
        np.testing.assert_allclose(styles, code.numpy(), atol=1e-5)
    assert result.shape == (2, 21, POSE)
    assert expected.std() > 0.3
    np.testing.assert_allclose(result, expected, atol=3e-4)


def test_quantised_engine_is_near_the_network():
    model = network()
    audio, past, z = speech(60), histories(2), latents(2, 53)
    poses = [
        engine.begin(past).frames(engine.windows(audio), z)
        for engine in (engine_of(model.export(), sizes_of(model.config, int8=int8)) for int8 in (True, False))
    ]
    assert 0 < relative(*poses) < 0.05  # 12 units; the paper's size is measured by benchmarks/flow.py


def test_lstm_cells():
    """One step whose coupling is PyTorch's LSTM."""
    sizes = FlowSizes(pose=POSE, audio=AUDIO, steps=1, hidden=10, layers=2, history=2, speech_frames=3, cell="lstm", int8=False)
    torch.manual_seed(1)
    from cospeech.models.nn.flow import Flow, RecurrentNet

    flow = Flow(POSE, 2 * POSE + 3 * AUDIO, 1, lambda i, o: RecurrentNet(torch.nn.LSTM, i, 10, o, 2), float("inf"))
    lively(flow)
    arrays = {f"flow.{name}": value.numpy() for name, value in flow.state_dict().items()}
    audio, past, z = speech(12), histories(1, 2), latents(1, 10)
    results = {}
    for int8 in (False, True):
        engine = engine_of(arrays, replace(sizes, int8=int8))
        results[int8] = engine.begin(past).frames(engine.windows(audio), z)
    poses, states = [torch.from_numpy(p) for p in past[0]], None
    for t in range(10):
        c = torch.cat([*poses[-2:], torch.from_numpy(audio[t : t + 3].ravel())])[None, None]
        with torch.no_grad():
            x, states = flow.inverse(torch.from_numpy(z[:, t : t + 1]), c, states)
        poses.append(x[0, 0])
    np.testing.assert_allclose(results[False][0], torch.stack(poses[2:]).numpy(), atol=2e-4)
    assert relative(results[True], results[False]) < 0.05


@pytest.mark.parametrize("int8", [False, True])
def test_takes_do_not_touch_each_other_and_pieces_do_not_show(int8):
    model = network()
    engine = engine_of(model.export(), sizes_of(model.config, int8=int8))
    windows, past, z = engine.windows(speech(90)), histories(8), latents(8, 83)
    whole = engine.begin(past).frames(windows, z)
    for take in (0, 5):
        alone = engine.begin(past[take : take + 1]).frames(windows, z[take : take + 1])
        assert alone.tobytes() == whole[take : take + 1].tobytes()
    takes, pieces, at = engine.begin(past), [], 0
    for count in (1, 2, 1, 30, 49):
        pieces.append(takes.frames(windows[at : at + count], z[:, at : at + count]))
        at += count
    assert np.concatenate(pieces, 1).tobytes() == whole.tobytes()
    assert not np.allclose(whole[0], whole[1])


def test_bytes_do_not_blur_small_steps():
    """Poses far from the mean that hardly move: what a network that sees steps hears of them must survive 7 bits."""
    model = network(residual=True, inertia=0.7, steps_seen=True, encoder=False)
    past = 1.5 + histories(40, 1) + 0.02 * histories(1)
    windows, z = speech(TINY.history + 1 + TINY.look_ahead)[None], latents(40, 1)
    steps = {}
    for int8 in (True, False):
        engine = engine_of(model.export(), sizes_of(model.config, int8=int8))
        steps[int8] = engine.begin(past).frames(windows, z)[:, 0] - past[:, -1]
    assert relative(steps[True], steps[False]) < 0.005  # 0.02 where the steps are folded into the weights


@pytest.mark.parametrize("changes", [{}, {"residual": True, "style": 4}], ids=["plain", "residual,style"])
@pytest.mark.parametrize(("int8", "most"), [(False, 1e-3), (True, 0.02)])
def test_latents_of_what_was_made_are_what_it_was_made_from(int8, most, changes):
    model = network(**changes)
    engine = engine_of(model.export(), sizes_of(model.config, int8=int8))
    audio, past, z = speech(40), histories(1), latents(1, 33)
    style = np.array([[0.9, -0.5, 0.1, 0.7]]) if changes else None
    poses = np.concatenate([past[0], engine.begin(past, style).frames(engine.windows(audio), z)[0]])
    poses = np.concatenate([poses, np.zeros((TINY.look_ahead, POSE), np.float32)])  # nobody looks at these
    result = engine.latents(poses, audio, style)
    assert result.shape == z[0].shape
    assert np.abs(result - z[0]).max() < most
    again = engine.begin(past, style).frames(engine.windows(audio), result[None])
    assert np.abs(again[0] - poses[TINY.history : -TINY.look_ahead]).max() < 2 * most


@pytest.mark.parametrize(
    "changes",
    [{}, {"residual": True}, {"residual": True, "inertia": 0.7, "steps_seen": True}, {"style": 4, "style_window": 9}],
    ids=["plain", "residual", "inertia", "style"],
)
def test_latents_are_those_of_the_network(changes):
    model = network(**changes)
    engine = engine_of(model.export(), sizes_of(model.config, int8=False))
    poses, audio = histories(1, 40)[0], speech(40)
    expected = model.latents(torch.from_numpy(poses)[None], torch.from_numpy(audio)[None])[0].detach().numpy()
    style = engine.style_code(poses[: model.style_frames]) if model.style_frames else None
    result = engine.latents(poses[model.style_frames :], audio[model.style_frames :], style)
    np.testing.assert_allclose(result, expected, atol=1e-3)


def test_a_pull_draws_poses_to_the_mean_and_latents_know_it():
    model = network(residual=True)
    free, with_feedback = (
        engine_of(model.export(), replace(sizes_of(model.config, int8=False), feedback_gain=feedback_gain))
        for feedback_gain in (1.0, 0.9)
    )
    audio, past, z = speech(60), histories(2), latents(2, 53)
    loose, near = (engine.begin(past).frames(engine.windows(audio), z) for engine in (free, with_feedback))
    np.testing.assert_allclose(near[:, 0], 0.9 * loose[:, 0], rtol=1e-5, atol=1e-6)
    assert near.std() < loose.std()
    poses = np.concatenate([past[0], near[0], np.zeros((TINY.look_ahead, POSE), np.float32)])
    assert np.abs(with_feedback.latents(poses, audio) - z[0]).max() < 1e-3


@pytest.mark.parametrize("message", ["first\nsecond", "", "\n"])
def test_an_error_of_onnxruntime_is_told_in_our_words_whatever_it_says(message):
    class Failing:
        def run(self, outputs, inputs):
            raise RuntimeError(message)

    with pytest.raises(InputError, match=r"^onnxruntime cannot run a graph \(is the bundle damaged\?\)$") as error:
        run_session(Failing(), {})
    assert str(error.value.__cause__) == message


def test_a_hostile_network_stays_within_bounds():
    """Weights a hundred times too large, 20,000 frames: no NaN, nothing beyond the bounds, still moving."""
    rng = np.random.default_rng(0)
    sizes = replace(sizes_of(replace(TINY, encoder=False, steps=2, hidden=8), int8=True))
    arrays = network(encoder=False, steps=2, hidden=8).export()
    arrays = {name: value * (100 if "rnn" in name or "out" in name else 1) for name, value in arrays.items()}
    arrays |= {name: value - 2 for name, value in arrays.items() if name.endswith("norm.logs")}  # each step blows up e² times
    edge = rng.uniform(1, 6, POSE)
    weights = pack_weights(arrays, sizes)
    engine = FlowEngine(sizes, weights, build_graphs(weights, sizes), -edge, edge)
    takes = engine.begin(np.zeros((1, sizes.history, POSE)))
    draw = StudentT(POSE, 1, seed=0, temperature=2.0)  # heavy tails
    for _ in range(20):
        poses = takes.frames(engine.windows(1e3 * speech(1000 + sizes.speech_frames - 1, 5)), draw.draw(1000)[None])[0]
        assert np.isfinite(poses).all()
        assert (np.abs(poses) <= edge * (1 + 1e-6)).all()
    assert poses.std(0).min() > 1e-3


def test_student_t():
    whole = StudentT(5, 4, seed=7).draw(60_000)
    pieces = StudentT(5, 4, seed=7)
    assert np.concatenate([pieces.draw(n) for n in (1, 0, 999, 59_000)]).tobytes() == whole.tobytes()
    assert not np.array_equal(whole[:9], StudentT(5, 4, seed=8).draw(9))
    assert np.array_equal(StudentT(5, 4, seed=7, temperature=0).draw(3), np.zeros((3, 5)))
    # |z|² / (ν·…): Σ z² / D is F-distributed with D, ν degrees; its mean is ν / (ν − 2)
    assert (whole.astype(float) ** 2).mean() == pytest.approx(2.0, rel=0.1)
    normal = StudentT(5, 0, seed=7).draw(60_000)
    assert normal.var() == pytest.approx(1, rel=0.02)
    assert (normal**4).mean() == pytest.approx(3, rel=0.05)
    square = (whole.astype(float) ** 2).mean(1)  # one χ² per frame: channels of a frame are large together
    assert np.corrcoef(whole[:, 0].astype(float) ** 2, whole[:, 1].astype(float) ** 2)[0, 1] > 0.05
    assert square.max() > 10


def test_quantised_matrices_are_near_and_fit_seven_bits():
    arrays, sizes = network().export(), sizes_of(TINY, int8=True)
    weights = pack_weights(arrays, sizes)
    exact = pack_weights(arrays, replace(sizes, int8=False))
    for name in ("past", "speech", "0.0.hh", "2.1.ih"):
        assert np.abs(weights[f"{name}.q"].astype(int)).max() == 63
        np.testing.assert_allclose(unpack(weights, name), exact[name], atol=np.abs(exact[name]).max() / 126 * 1.001)
    assert sum(v.nbytes for v in weights.values()) < 0.6 * sum(v.nbytes for v in exact.values())


def test_what_does_not_fit_is_refused():
    arrays, sizes = network().export(), sizes_of(TINY, int8=True)
    for wrong in (replace(sizes, hidden=11), replace(sizes, steps=4), replace(sizes, pose=8), replace(sizes, feature=5)):
        with pytest.raises(InputError, match="weights"):
            pack_weights(arrays, wrong)
    with pytest.raises(InputError, match="not finite"):
        pack_weights(arrays | {"flow.steps.1.mix.log_s": np.full(POSE, np.nan, np.float32)}, sizes)
    with pytest.raises(InputError, match="cells"):
        replace(sizes, cell="relu")
    with pytest.raises(InputError, match="hidden"):
        FlowSizes(**{**asdict(sizes), "hidden": 10**9})
    weights = pack_weights(arrays, sizes)
    graphs = build_graphs(weights, sizes)
    edge = np.ones(POSE)
    with pytest.raises(InputError, match="bounds"):
        FlowEngine(sizes, weights, graphs, edge, -edge)
    with pytest.raises(InputError):
        FlowEngine(sizes, weights, graphs | {"frame": graphs["speech"]}, -edge, edge)
    with pytest.raises(InputError):
        FlowEngine(replace(sizes, history=6, speech_frames=8), weights, graphs, -edge, edge)
    engine = FlowEngine(sizes, weights, graphs, -edge, edge)
    with pytest.raises(InputError, match="histories"):
        engine.begin(np.zeros((1, 4, POSE)))
    with pytest.raises(InputError, match="latents"):
        engine.begin(histories(1)).frames(engine.windows(speech(10)), latents(1, 4))
    with pytest.raises(InputError, match="poses"):
        engine.latents(histories(1, 5)[0], speech(5))


def test_with_all_that_is_ours_off_it_is_the_published_model():
    own = {field.name for field in fields(FlowConfig)}
    torch.manual_seed(0)
    paper = lively(StylisedFlow(FlowConfig(**{k: v for k, v in vars(TINY).items() if k in own}), pose=POSE, audio=AUDIO))
    ours, draw = network(), torch.Generator().manual_seed(5)
    shapes = {"pose": (3, paper.window, POSE), "audio": (3, paper.window, AUDIO)}
    arrays = {name: torch.randn(*shape, generator=draw) for name, shape in shapes.items()}
    assert paper.runtime_sizes() == ours.runtime_sizes()
    assert paper.loss(Batch(arrays, StepRandom(0, 0)), 0) == ours.loss(Batch(arrays, StepRandom(0, 0)), 0)
    z = torch.randn(3, 6, POSE, generator=draw)
    past, audio = arrays["pose"][:, : TINY.history], torch.randn(3, 5 + paper.speech_frames, AUDIO, generator=draw)
    assert torch.equal(paper.sample(z, past, audio), ours.sample(z, past, audio))
