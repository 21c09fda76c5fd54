"""MoGlow beyond the contract of all networks: the engine without torch gives the same, and controls reach the poses."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.audio.features.frames import AUDIO_NAMES, audio_features  # noqa: E402
from cospeech.audio.features.reduce import audio_width  # noqa: E402
from cospeech.audio.speech import Speech, example  # noqa: E402
from cospeech.corpora.store import Store  # noqa: E402
from cospeech.corpora.store_files import Entry  # noqa: E402
from cospeech.corpora.store_writer import Piece, write_store  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.models.moglow import MoGlow, MoGlowConfig  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.motion.points import Points  # noqa: E402
from cospeech.motion.poses import find_pose  # noqa: E402
from cospeech.motion.poses.controls import CONTROLS, control_row, read_controls, style_controls  # noqa: E402
from cospeech.runtime.flow.engine import FlowEngine  # noqa: E402
from cospeech.runtime.flow.graph import build_graphs  # noqa: E402
from cospeech.runtime.flow.weights import FlowSizes, pack_weights  # noqa: E402
from cospeech.runtime.model import TrainedModel  # noqa: E402
from cospeech.training.checkpoint import load_run, read_tensors  # noqa: E402
from cospeech.training.export.bundles import bundle_run  # noqa: E402
from cospeech.training.recipe import read_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402

torch.set_num_threads(1)
FPS, AUDIO, FEATURES = 15.0, 3, audio_width("mel20-prosody")
MODEL = {"steps": 2, "hidden": 12, "history": 4, "look_ahead": 2, "frames": 10, "residual": True, "controls": ["hand_height"]}


@pytest.mark.parametrize(("nu", "residual"), [(0, False), (50, True)])
def test_the_engine_without_torch_makes_the_same_poses(nu, residual):
    torch.manual_seed(0)
    config = MoGlowConfig(
        steps=3, hidden=12, history=4, look_ahead=2, frames=5, nu=nu, residual=residual, controls=("hand_speed", "hand_height")
    )
    net = MoGlow(config, pose=7, audio=AUDIO).eval()
    with torch.no_grad():
        for value in net.parameters():
            value.add_(0.1 * torch.randn_like(value))
    sizes = FlowSizes(**net.runtime_sizes(), int8=False)
    weights = pack_weights(net.export(), sizes)
    engine = FlowEngine(sizes, weights, build_graphs(weights, sizes), np.full(7, -50.0), np.full(7, 50.0))
    rng = np.random.default_rng(0)
    z, history = rng.normal(size=(2, 9, 7)).astype(np.float32), rng.normal(size=(2, 4, 7)).astype(np.float32)
    audio, control = rng.normal(size=(15, AUDIO)).astype(np.float32), rng.normal(size=(15, 3)).astype(np.float32)
    both = [torch.from_numpy(x)[None].expand(2, -1, -1) for x in (audio, control)]
    expected = net.sample(torch.from_numpy(z), torch.from_numpy(history), *both).numpy()
    rows = net.hear(*both)[0].numpy()
    assert np.array_equal(rows, np.concatenate([audio, control[:, [1, 0]]], 1))  # controls are columns like those of speech
    takes = engine.begin(history)
    poses = takes.frames(engine.windows(rows), z)
    assert np.abs(poses - expected).max() < 1e-4


def swinging(seed: int, frames: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Arms that swing about a height that changes every 6 seconds; speech that says nothing of it."""
    rng = np.random.default_rng(seed)
    height = np.repeat(rng.uniform(-1, 1, frames // 90 + 1), 90)[:frames]
    swing = 0.3 * np.sin(np.arange(frames) * 0.7 + rng.uniform(0, 6)) + 0.05 * rng.normal(size=frames)
    points = np.zeros((frames, 10, 3))
    points[:, 1:4] = [[0, 0.26, 0], [0, 0.44, 0.05], [0, 0.58, 0]]
    for first, side in ((4, 1.0), (7, -1.0)):
        points[:, first] = [side * 0.22, 0.26, 0]
        points[:, first + 1] = [side * 0.26, -0.1, 0.02]
        angle = height + swing
        points[:, first + 2] = points[:, first + 1] + np.stack(
            [0 * angle + side * 0.05, 0.33 * np.sin(angle), 0.33 * np.cos(angle)], -1
        )
    pose = find_pose("direction-vectors")
    audio = np.resize(np.roll(spoken(), rng.integers(200), 0), (frames, len(AUDIO_NAMES)))
    return pose.encode(Points(FPS, points, "ted")).astype(np.float32), audio


@cache
def spoken() -> np.ndarray:
    """Features of a real voice, so that the network has learnt from a real voice."""
    speech = Speech.load(example()[0])
    return audio_features(speech, int(speech.duration * FPS), FPS)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A short run on arms that swing high and low."""
    folder = tmp_path_factory.mktemp("moglow")

    def piece(k: int) -> Piece:
        pose, audio = swinging(k)
        entry = Entry(f"c{k}", "a", "validation" if k > 13 else "train", 0, len(pose), 0.0, ("pose", "audio"))
        return Piece(entry, (), lambda: {"pose": pose, "audio": audio})

    names = {"pose": find_pose("direction-vectors").names, "audio": AUDIO_NAMES}
    write_store(folder / "s", [piece(k) for k in range(16)], corpus="ted", pose="direction-vectors", fps=FPS, names=names)
    recipe = {
        "model": {"name": "moglow", **MODEL, "pose_noise": 0.02},
        "data": {"audio": "mel20-prosody"},
        "train": {"steps": 150, "batch": 24, "lr": 5e-3, "threads": 1, "device": "cpu", "validate_every": 0, "save_every": 150},
    }
    report = train(read_recipe(recipe), Store(folder / "s"), folder / "r")
    assert report.step == 150
    return folder / "r"


def test_a_control_at_a_higher_quantile_lifts_the_hands(run):
    net, facts = load_run(run)
    assert net.arrays == ("pose", "audio", "control")
    assert facts["config"]["controls"] == ["hand_height"]
    statistics, _ = read_tensors(run / "statistics.safetensors")
    statistics = {name: value.numpy() for name, value in statistics.items()}
    assert statistics["control_quantiles"].shape == (101, 3)
    heights = []
    for text in ("hand_height:0.15", "hand_height:0.5", "hand_height:0.85"):
        row = control_row(read_controls(text), statistics["control_quantiles"])
        control = torch.from_numpy((row - statistics["control_mean"]) / statistics["control_std"]).float()
        z = net.flow.latent.sample(StepRandom(0, 0).normal, 8, 90)
        history, audio = torch.zeros(8, 4, 27), torch.zeros(8, 96, FEATURES)
        poses = (
            net.sample(z, history, audio, control.expand(8, 96, 3)).numpy() * statistics["pose_std"] + statistics["pose_mean"]
        )
        got = [style_controls(one[30:], find_pose("direction-vectors"), FPS)[:, 0].mean() for one in poses]
        heights.append((float(np.mean(got)), row[0]))
    (low, low_due), (middle, _), (high, high_due) = heights
    assert low < middle < high
    assert high - low > 0.5 * (high_due - low_due)


def test_and_in_a_bundle_that_speech_is_played_with(run, tmp_path):
    bundle_run(run, tmp_path / "a.cospeech")
    player = TrainedModel.open(tmp_path / "a.cospeech")
    speech = Speech.load(example()[0]).window(0, 6)
    heights = []
    for style in ("hand_height:0.1", None, "hand_height:0.9"):
        motion = player.generate(speech, style=style, seed=3, fps=FPS, parts=("body",))
        hands = [motion.skeleton.index[name] for name in ("leftHand", "rightHand")]
        heights.append(float((motion.positions()[20:, hands, 1] - motion.positions()[20:, :1, 1]).mean()))
    assert heights[0] < heights[1] < heights[2]
    assert heights[2] - heights[0] > 0.03  # metres
    with pytest.raises(InputError, match="hand_speed"):
        player.generate(speech, style="hand_speed:0.5")


def test_controls_that_are_none_are_told_when_the_run_begins(run, tmp_path):
    recipe = read_recipe({"model": {"name": "moglow", **MODEL, "controls": ["hand_hight"]}})
    with pytest.raises(InputError, match="hand_height"):
        train(recipe, Store(run.parent / "s"), tmp_path / "r")


def test_likelihood_in_bits_is_that_in_nats_over_ln_2():
    torch.manual_seed(0)
    nets = [MoGlow(MoGlowConfig(steps=1, hidden=4, history=2, look_ahead=0, frames=3, nll_unit=unit), pose=4, audio=1).eval()
            for unit in (1.0, np.log(2))]  # fmt: skip
    nets[1].load_state_dict(nets[0].state_dict())
    data = Batch({"pose": torch.randn(2, 5, 4), "audio": torch.randn(2, 5, 1)}, StepRandom(0, 0))
    nats, bits = (net.loss(data, 0)["nll"].item() for net in nets)
    assert bits == pytest.approx(nats / np.log(2), rel=1e-6)
    assert nats == pytest.approx(-nets[0].log_prob(data["pose"], data["audio"]).mean().item())
    assert {"hand_height", "hand_speed", "hand_radius"} == {*CONTROLS}
