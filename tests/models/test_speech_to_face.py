"""Speech to face: how far it hears, what its losses count, and what is done to speech in training."""

from __future__ import annotations

import sys
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.errors import InputError  # noqa: E402
from cospeech.models import speech_to_face  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.models.speech_to_face import CALM, SpeechToFace, SpeechToFaceConfig  # noqa: E402
from cospeech.motion.poses.face import FACE, MIRROR  # noqa: E402
from cospeech.motion.skeletons.arkit import ARKIT_INDEX  # noqa: E402
from cospeech.runtime.sliding_window_decoder import live  # noqa: E402
from cospeech.training.checkpoint import read_tensors, write_tensors  # noqa: E402
from cospeech.training.recipe import SHIPPED, build, load_recipe  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
NO_AUGMENTATION = {"gain_augmentation": 0.0, "tilt": 0.0, "tract": 0.0, "noise": 0.0, "pauses": 0.0, "band_limits": 0.0}
ROWS, BANDS, SPEAKERS = 6, 12, 2
JAW = ARKIT_INDEX["jawOpen"]


def network(pose: int = 55, **changes) -> SpeechToFace:
    torch.manual_seed(0)
    net = SpeechToFace(SpeechToFaceConfig(**{"channels": 8, "frames": 48} | changes), pose=pose, audio=BANDS, speakers=SPEAKERS)
    draw = torch.Generator().manual_seed(1)
    uniform = lambda n, low, high: low + (high - low) * torch.rand(n, generator=draw)  # noqa: E731
    net.set_statistics({
        "pose_mean": uniform(pose, 0.01, 0.1), "pose_std": uniform(pose, 0.01, 0.1),
        "pose_quantiles": uniform(SPEAKERS * 101 * pose, 0.0, 0.3).reshape(SPEAKERS, 101, pose).sort(1).values,
        "audio_mean": uniform(BANDS, -4, -2), "audio_std": uniform(BANDS, 1, 2),
    })  # fmt: skip
    return net.eval()


def batch(net, seed: int = 0) -> Batch:
    draw = torch.Generator().manual_seed(seed)
    arrays = {
        "pose": torch.randn(ROWS, net.window, net.pose, generator=draw),
        "audio": torch.randn(ROWS, net.window, BANDS, generator=draw),
        "speaker": torch.arange(ROWS) % SPEAKERS,
    }
    return Batch(arrays, StepRandom(seed, 0))


@pytest.mark.parametrize("config", [{}, {"dilations": (1, 3), "ahead": (0, 4)}, {"kernel": 3, "ahead": (0, 0, 0)}])
def test_a_frame_hears_as_far_as_its_config_says(config):
    net = network(**config)
    rows = torch.randn(1, 101, BANDS, requires_grad=True)
    face = net.make(rows, torch.ones(1, 101, SPEAKERS) / SPEAKERS, torch.zeros(1, 101, 0))[0, 50]
    (gradient,) = torch.autograd.grad(face.square().sum(), rows)
    frames = gradient[0].abs().sum(-1).nonzero().ravel() - 50
    assert (-int(frames.min()), int(frames.max())) == (net.config.past, net.config.future)


def test_as_it_ships_a_stream_hears_all_that_matters():
    """A window as the runtime lays them has room for all that a frame hears, before and after."""
    config = build(SpeechToFaceConfig, load_recipe(SHIPPED / "speech_to_face.toml").config, "model")
    net = SpeechToFace(config, pose=55, audio=40, speakers=2)
    from tests.support.exports import export_graphs

    setting = live(export_graphs(net.export_module()).signatures["make"])
    assert setting.ahead >= config.future
    assert setting.past >= config.past
    assert config.future / FACE.fps <= 0.3


def test_no_loss_comes_from_frames_whose_surroundings_the_window_cuts():
    """The same frames in a longer window are the same: nothing is heard of the zeros beyond the ends."""
    net = network(**NO_AUGMENTATION)
    data = batch(net)
    style = torch.eye(SPEAKERS)[data["speaker"]][:, None].expand(-1, net.window, -1)
    wide = torch.cat([torch.randn(ROWS, 9, BANDS), data["audio"], torch.randn(ROWS, 9, BANDS)], 1)
    with torch.no_grad():
        short = net.make(data["audio"], style, style[..., :0])
        long = net.make(wide, torch.nn.functional.pad(style, (0, 0, 9, 9), mode="replicate"), wide[..., :0])[:, 9:-9]
    inside = slice(net.config.past, net.window - net.config.future)
    assert torch.allclose(short[:, inside], long[:, inside], atol=1e-5)
    assert not torch.allclose(short[:, 0], long[:, 0], atol=1e-3)


def test_the_loss_is_the_distance_in_units_of_weights():
    """Computed in NumPy, frame by frame, in standard deviations."""
    net = network(**NO_AUGMENTATION)
    data = batch(net)
    mean, std = net.pose_mean.numpy(), net.pose_std.numpy()
    speaker = data["speaker"].numpy()
    style = torch.eye(SPEAKERS)[data["speaker"]][:, None].expand(-1, net.window, -1)
    with torch.no_grad():
        face = net.make(data["audio"], style, style[..., :0]).numpy() * std + mean
        terms = net.loss(data, 0)
    real = data["pose"].numpy() * std + mean
    even = (real + real[..., list(MIRROR)]) / 2
    even[..., 52:] = real[..., 52:]
    face[..., :52] = np.where(face[..., :52] < 0, 0.02 * face[..., :52], face[..., :52])
    rows = slice(net.config.past, net.window - net.config.future)
    shares = np.ones(55)
    shares[52:] = 0.25
    shares[JAW] = net.config.jaw
    quantiles = net.pose_quantiles.numpy()
    units = np.maximum(quantiles.std(1, ddof=1), 0.3 * std)
    face, jaw = face[:, rows] / units[speaker, None], even[:, rows, JAW]
    even = even[:, rows] / units[speaker, None]
    off, speed = np.abs(face - even), np.abs(np.diff(face, axis=1) - np.diff(even, axis=1))
    off = (1 - net.config.squared) * off + net.config.squared * off**2 / 2
    around = np.stack([np.roll(np.pad(jaw, ((0, 0), (9, 9)), constant_values=-np.inf), k, 1) for k in range(-9, 10)]).max(0)
    closures = (jaw < 0.03) & (around[:, 9:-9] > 0.06)
    assert closures.any()
    at_closures = (off[..., JAW] * closures).mean() * net.config.jaw / 55
    assert terms["distance"].item() == pytest.approx((off * shares).mean() + net.config.closure * at_closures, rel=1e-4)
    assert terms["velocity"].item() == pytest.approx(net.config.velocity * (speed * shares).mean(), rel=1e-4)
    short = []
    for number in range(SPEAKERS):
        own = np.minimum(face[speaker == number].reshape(-1, 55), quantiles[number, -2] / units[number])
        moves = own.std(0, ddof=1) * units[number] / quantiles[number].std(0, ddof=1)
        short.append(np.maximum(net.config.goal - moves, 0) * shares)
    assert np.mean(short) > 0
    assert terms["spread"].item() == pytest.approx(net.config.spread * np.mean(short), rel=1e-3)


def test_a_lip_that_stands_still_is_pushed_to_move_and_one_that_moves_enough_is_left_alone():
    """However rarely the tracked lip moves, and whether it moves in this batch or not."""
    net = network(**NO_AUGMENTATION)
    net.pose_quantiles.zero_()
    net.pose_quantiles[:, -3:] = 0.5
    calm = 0.001 * torch.rand(SPEAKERS, 200, 55, generator=torch.Generator().manual_seed(2))
    lively = torch.zeros(SPEAKERS, 200, 55)
    lively[:, ::40] = 0.5 / net.units[:, None]
    short = lambda face: net._short_of_spread(face, torch.arange(SPEAKERS), torch.zeros(SPEAKERS, 200), torch.ones(55))  # noqa: E731
    calm.requires_grad_()
    short(calm).backward()
    assert calm.grad is not None
    most = calm.detach().flatten(0, 1).argmax(0)
    assert (calm.grad.flatten(0, 1).gather(0, most[None]) < 0).all()  # what moves most is to move further
    assert short(lively) == 0 < short(calm)


def test_a_number_that_never_moves_stays_what_it_is():
    net = network()
    net.set_statistics({
        "pose_mean": torch.tensor([0.0, 0.1] * 27 + [0.0]), "pose_std": torch.ones(55),
        "pose_quantiles": torch.ones(SPEAKERS, 101, 55),
        "audio_mean": torch.zeros(BANDS), "audio_std": torch.ones(BANDS),
    })  # fmt: skip
    with torch.no_grad():
        face = net.make(torch.randn(2, 30, BANDS), torch.ones(2, 30, SPEAKERS), torch.zeros(2, 30, 0))
    assert not face[..., ::2].any()
    assert (face[..., 1::2].abs().amax((0, 1)) > 0).all()


# what is done to speech ---------------------------------------------------------------------------------------------------


def augment(net, seed: int = 0):
    data = batch(net, seed)
    face = torch.ones(ROWS, net.window, 55)
    audio, face_with_rest, rest = net._augment(data["audio"], face, StepRandom(seed, 0))
    assert torch.equal(face_with_rest, face * (1 - rest[..., None]))
    return data["audio"] * net.audio_std + net.audio_mean, audio * net.audio_std + net.audio_mean, face_with_rest


def test_with_nothing_asked_for_speech_is_as_it_was():
    before, after, face = augment(network(**NO_AUGMENTATION))
    assert torch.allclose(before, after, atol=1e-4)
    assert (face == 1).all()


def test_louder_is_a_shift_of_all_bands_and_tilt_a_slope():
    before, after, _ = augment(network(**NO_AUGMENTATION | {"gain_augmentation": 2.0}))
    shift = after - before
    assert torch.allclose(shift, shift[:, :1, :1].expand_as(shift), atol=1e-3)
    assert 0.1 < shift.abs().max() <= 2
    before, after, _ = augment(network(**NO_AUGMENTATION | {"tilt": 1.0}))
    bend = (after - before).diff(dim=2).diff(dim=2)
    assert bend.abs().max() < 1e-3
    assert (after - before).abs().max() <= 1.001


def test_a_longer_tract_moves_bands_down_the_axis():
    axis = torch.linspace(0, 1, BANDS).expand(3, 5, BANDS)
    factors = torch.tensor([[1.0], [0.9], [1.1]])
    bands = speech_to_face._stretch(axis, factors)
    expected = np.clip(np.arange(BANDS) * factors.numpy(), 0, BANDS - 1) / (BANDS - 1)
    np.testing.assert_allclose(bands[:, 0].numpy(), expected, atol=1e-6)


def test_noise_adds_power_and_never_takes_any():
    before, after, face = augment(network(**NO_AUGMENTATION | {"noise": 1.0}))
    assert (after >= before - 1e-3).all()
    assert (after - before).max() > 0.5
    assert (face == 1).all()


def test_a_band_limit_takes_the_ends_of_the_axis_and_leaves_its_middle():
    before, after, face = augment(network(**NO_AUGMENTATION | {"band_limits": 1.0}))
    loss, axis = before - after, np.linspace(-1, 1, BANDS)
    middle = (axis >= speech_to_face.LOW[1]) & (axis <= speech_to_face.HIGH[0])
    assert loss[..., middle].abs().max() < 1e-3
    assert (loss > -1e-3).all()
    assert (loss[:, 0, -1] > 5).any()  # natural log of power: 22 dB
    assert (face == 1).all()
    half = speech_to_face._band_limits(StepRandom(0, 0), 400, torch.linspace(-1, 1, 40), 0.35).amax(1) > 0
    assert 0.28 < half.float().mean() < 0.42


def test_in_pauses_there_is_silence_and_a_face_at_rest():
    _, after, face = augment(network(**NO_AUGMENTATION | {"pauses": 1.0}))
    silent = (after - CALM).abs().amax(2) < 1e-3
    assert silent.any(1).all()  # of every window some
    deep = torch.nn.functional.avg_pool1d(silent[:, None].float(), 9, 1, 4, count_include_pad=False)[:, 0] == 1
    assert deep.any()
    assert not face[deep].any()
    far = torch.nn.functional.max_pool1d(silent[:, None].float(), 9, 1, 4)[:, 0] == 0
    assert (face[far] == 1).all()
    assert face.diff(dim=1).abs().max() <= 1 / 5 + 1e-5  # no jump, however near the ends


@pytest.mark.parametrize(
    "wrong",
    [{"frames": 20}, {"channels": 0}, {"velocity": -1.0}, {"dilations": ()}, {"dilations": (0, 1, 2)}, {"ahead": (1, 1)},
     {"ahead": (5, 0, 0)}, {"ahead": (-1, 0, 0)}, {"gain_augmentation": float("nan")}],
    ids=str,
)  # fmt: skip
def test_sizes_that_are_none_are_told(wrong):
    with pytest.raises(InputError):
        replace(SpeechToFaceConfig(), **wrong)


def test_what_a_bundle_is_made_of_is_calibrated_too(tmp_path, monkeypatch):
    spec = spec_from_file_location("calibrate_face", ROOT / "tools" / "calibrate_face.py")
    tool = module_from_spec(spec)
    monkeypatch.syspath_prepend(ROOT / "tools")
    monkeypatch.setitem(sys.modules, "calibrate_face", tool)
    spec.loader.exec_module(tool)
    net = network()
    (tmp_path / "run").mkdir()
    state = {"step": 5, "best": {"name": "face", "value": 1.0, "step": 5}}
    write_tensors(tmp_path / "run" / "last.safetensors", {f"model.{name}": t for name, t in net.state_dict().items()}, state)
    write_tensors(tmp_path / "run" / "best.safetensors", net.state_dict(), state)
    monkeypatch.setattr(tool, "load_run", lambda run, which: (net, {"store": {"speakers": ["anna", "bob"]}}))
    monkeypatch.setattr(tool, "Store", lambda path: None)
    monkeypatch.setattr(tool, "play", lambda run, store: {"bob": {}})
    lines = np.tile([1.0, 0.0], (len(ARKIT_INDEX), 1))
    lines[JAW] = 2.0, 0.01
    monkeypatch.setattr(tool, "stretches", lambda splits: lines)
    assert list(tool.calibrate(tmp_path / "run", tmp_path / "store", tmp_path / "sized")) == ["bob jawOpen 2.00 0.010"]
    last, best = (read_tensors(tmp_path / "sized" / f"{which}.safetensors")[0] for which in ("last", "best"))
    assert best.keys() == net.state_dict().keys()
    assert all(torch.equal(best[name], last[f"model.{name}"]) for name in best)
    rows = torch.nonzero((best["out.weight"] != net.state_dict()["out.weight"]).flatten(1).any(1)).flatten().tolist()
    assert rows == [net.pose + JAW]
