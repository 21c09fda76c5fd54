"""From a store with words and samples to a bundle of a network whose windows begin with the poses of the window before."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch (the train extra)")
pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.audio.features.frames import AUDIO_NAMES, audio_features  # noqa: E402
from cospeech.audio.features.waveform import WAVEFORM_NAMES, waveform_rows  # noqa: E402
from cospeech.audio.speech import Speech, example  # noqa: E402
from cospeech.corpora.store import Store  # noqa: E402
from cospeech.corpora.store_files import Entry  # noqa: E402
from cospeech.corpora.store_writer import Piece, write_store  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.motion.motion import Motion  # noqa: E402
from cospeech.motion.poses import find_pose  # noqa: E402
from cospeech.rules import RuleBasedModel  # noqa: E402
from cospeech.runtime.model import TrainedModel  # noqa: E402
from cospeech.training.checkpoint import load_run  # noqa: E402
from cospeech.training.dataset import open_set  # noqa: E402
from cospeech.training.export.bundles import bundle_run  # noqa: E402
from cospeech.training.recipe import read_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402
from tests.support.runtime_bundles import cut, same  # noqa: E402

FPS, BONES = 15.0, 19  # of the 57 numbers of a pose
_SMALL = {"frames": 10, "hidden": 6, "layers": 1, "word_width": 4}
_CHAIN = {"bones": [[k, k + 1] for k in range(BONES - 1)], "parts": [[*range(9)], [*range(9, BONES)]], "part_edges": [[0, 1]]}
MODELS = {
    "trimodal": ("waveform", _SMALL | {"audio": 4, "text": 4, "speaker": 3}),
    "joint-embedding": ("waveform", _SMALL | {"frames": 12, "speech_hidden": 6, "pose_channels": 4, "code": 4}),
    "seq2seq": ("prosody", _SMALL),
    "speech2affective-gestures": ("mfcc14", _SMALL | _CHAIN | {"audio": 4, "text": 4, "speaker": 3}),
    "speech2gesture": ("mel20-prosody", {"frames": 20, "channels": 8, "depth": 3, "discriminator_channels": 4, "seed": 3}),
}
NOISY = ("trimodal", "joint-embedding", "speech2affective-gestures")


def recipe(name):
    audio, config = MODELS[name]
    settings = {"steps": 3, "batch": 4, "threads": 1, "device": "cpu", "validate_every": 0, "save_every": 3}
    return read_recipe({"model": {"name": name, **config}, "data": {"audio": audio}, "train": settings})


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Two speakers of our rules (synthetic)."""
    folder = tmp_path_factory.mktemp("seeded")
    speech, pose, pieces = Speech.load(example()[0]).window(0, 3), find_pose("expmap-humanoid"), []
    for k, (name, style) in enumerate([("big", "lively"), ("small", "reserved")]):
        motion = RuleBasedModel().generate(speech, style=style, seed=k, fps=FPS, parts=("body",))
        frames = len(motion)
        values = {
            "pose": pose.encode(motion).astype(np.float32), "audio": audio_features(speech, frames, FPS),
            "waveform": waveform_rows(speech, frames, FPS).astype(np.float16),
            "word": (np.arange(frames) // 9 % 3).astype(np.int32),
        }  # fmt: skip
        entry = Entry(name, name, "train", 0, frames, 0.0, tuple(values))
        pieces.append(Piece(entry, ("yes", "mountains"), lambda values=values: dict(values)))
    names = {"pose": pose.names, "audio": AUDIO_NAMES, "waveform": WAVEFORM_NAMES}
    write_store(folder, pieces, corpus="beat", pose="expmap-humanoid", fps=FPS, names=names)
    return Store(folder)


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_a_run_becomes_a_bundle_that_plays_as_speech_comes_what_it_plays_at_once(store, name, tmp_path):
    train(recipe(name), store, tmp_path / "run")
    bundle_run(tmp_path / "run", tmp_path / "it.cospeech", small=False)
    player, speech = TrainedModel.open(tmp_path / "it.cospeech"), Speech.load(example()[0]).window(0, 2)
    network = player.system.networks["make"]
    assert network.signature.feeds_back
    assert network.signature.window == MODELS[name][1]["frames"]  # as long as in training
    assert network.signature.normal_noise is (name in NOISY)
    assert network.signature.hop == network.signature.window - 4 - network.signature.look_ahead
    takes = player.generate_takes(speech, takes=2, seed=2, parts=("body",))
    assert len(takes[0]) == speech.frames(30.0)
    assert np.isfinite(takes[0].rotations).all()
    assert same(*takes) is (name not in NOISY)
    pieces = player.stream(cut(speech, [7, 9000, 20_000]), seed=2, parts=("body",))
    assert same(Motion.concatenate([*pieces]), takes[0])
    check_window(network, load_run(tmp_path / "run")[0])


def check_window(network, net):
    """Of a window with known poses, different for two takes, the bundle makes what PyTorch makes."""
    rng, frames = np.random.default_rng(0), network.signature.probe
    rows, style, noise, seed = (
        rng.normal(0, 0.5, (2, frames, width)).astype(np.float32) for width in (net.audio, net.styles, net.modes, net.pose + 1)
    )
    rows[1] = rows[0]
    seed[:, :4, -1], seed[:, 4:] = 1, 0
    with torch.no_grad():
        expected = net.make(*map(torch.from_numpy, (rows, style, noise, seed))).numpy()
    ports = {"rows": rows[:1], "style": style, "noise": noise, "seed": seed}
    poses = network.run(**{port: x for port, x in ports.items() if port in network.signature.inputs})["poses"]
    inside = (expected > network._bounds["poses"][0]) & (expected < network._bounds["poses"][1])
    assert inside.mean() > 0.3
    np.testing.assert_allclose(poses[inside], expected[inside], atol=1e-4)


def test_samples_are_standardised_as_one(store):
    """All columns of a waveform have one mean and deviation; what the store lacks is told with the option that keeps it."""
    data = open_set(recipe("trimodal"), store, torch.device("cpu"))
    audio = data.standards["audio"]
    samples = store.arrays["waveform"][:].astype(float)
    assert len({*audio.mean.tolist()}) == len({*audio.std.tolist()}) == 1
    assert (audio.mean[0], audio.std[0]) == pytest.approx((samples.mean(), samples.std()), rel=1e-3, abs=1e-6)
    bare = Store(store.folder)
    bare.arrays = {name: array for name, array in bare.arrays.items() if name != "waveform"}
    with pytest.raises(InputError, match="--waveform"):
        open_set(recipe("trimodal"), bare, torch.device("cpu"))
