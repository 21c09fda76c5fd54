"""Feature nets: a trained autoencoder as a function of recordings, and what it refuses."""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import asdict, replace

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.cli.evaluate import register  # noqa: E402
from cospeech.corpora import Clip  # noqa: E402
from cospeech.corpora.store_files import Entry  # noqa: E402
from cospeech.corpora.store_writer import Piece, write_store  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.evaluation import evaluate as cospeech_evaluate  # noqa: E402
from cospeech.metrics import Sample, Tools, load_metric  # noqa: E402
from cospeech.models.feature_net import feature_net, fingerprint, vectors_of  # noqa: E402
from cospeech.models.gesture_autoencoder import AutoencoderConfig, FgdAutoencoder, FgdConfig, GestureAutoencoder  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.motion.motion import Motion  # noqa: E402
from cospeech.motion.poses import find_pose  # noqa: E402
from cospeech.motion.rotations import quat_multiply, rotvec_to_quat  # noqa: E402
from cospeech.motion.skeleton import find_skeleton  # noqa: E402
from cospeech.training.checkpoint import write_facts, write_tensors  # noqa: E402
from cospeech.training.feature_networks import load_features  # noqa: E402

torch.set_num_threads(1)
FPS = 15.0


def walk(seed: int, frames: int = 120, smooth: int = 8, size: float = 0.3):
    """Smooth random numbers (T, 27) about a constant pose."""
    noise = np.random.default_rng(seed).normal(size=(frames + smooth, 27)).cumsum(0)
    moving = (noise[smooth:] - noise[:-smooth]) * size / smooth**0.5
    return np.random.default_rng(99).normal(size=27) + moving


def sample(seed: int, noise: float = 0.0) -> Sample:
    pose = find_pose("direction-vectors")
    values = walk(seed) + noise * np.random.default_rng(seed).normal(size=(120, 27))
    return Sample(f"clip{seed}", FPS, positions=pose.decode(values, FPS).values)


def trained() -> tuple[FgdAutoencoder, np.ndarray, np.ndarray]:
    torch.manual_seed(0)
    net = FgdAutoencoder(FgdConfig(channels=8, hidden=32, code=8), pose=27)
    data = np.concatenate([vectors_of(sample(seed), find_pose("direction-vectors"), FPS) for seed in range(20)])
    mean, std = data.mean(0), data.std(0)
    rows = torch.from_numpy(((data - mean) / std).astype(np.float32)).split(40)
    optimiser = torch.optim.Adam(net.parameters(), 3e-3)
    for step in range(40):
        optimiser.zero_grad()
        windows = torch.stack([rows[k][step % 6 : step % 6 + 34] for k in range(len(rows))])
        sum(net.loss(Batch({"pose": windows}, StepRandom(0, step)), step).values()).backward()
        optimiser.step()
    return net, mean, std


@pytest.fixture(scope="module")
def features():
    net, mean, std = trained()
    return feature_net(net, name="fgd-autoencoder", pose="direction-vectors", fps=FPS, mean=mean, std=std)


def test_fgd_of_a_trained_net_puts_what_moves_otherwise_farther_away(features):
    truth, others = [sample(seed) for seed in range(100, 112)], [sample(seed) for seed in range(200, 212)]
    frozen = [replace(one, positions=np.broadcast_to(one.positions[:1], one.positions.shape)) for one in others]
    noise = [[sample(seed, noise) for seed in range(200, 212)] for noise in (1.0, 2.0)]
    measure = load_metric("fgd")
    same, other, still, noisy, noisier = (
        measure(row, truth, Tools(features=features)) for row in (truth, others, frozen, *noise)
    )
    assert same.value < 1e-9
    assert still.value > 2 * other.value
    assert noisier.value > noisy.value > 2 * other.value
    assert features.name in other.note
    assert other.count == 12 * 9  # 120 frames, windows of 34, hop 10


def test_the_name_tells_networks_apart_and_says_what_they_see(features):
    first, other = (FgdAutoencoder(FgdConfig(), pose=27) for _ in range(2))
    assert fingerprint(first) != fingerprint(other)
    other.load_state_dict(first.state_dict())
    assert fingerprint(first) == fingerprint(other)
    assert features.name.startswith("fgd-autoencoder ")
    assert features.name.endswith("direction-vectors at 15 fps")


def test_features_do_not_depend_on_the_other_windows(features):
    windows = np.random.default_rng(0).normal(size=(5, 34, 27))
    assert np.allclose(features.function(windows)[2], features.function(windows[2:3])[0], atol=1e-5)


def test_vectors_of_rotations_are_those_of_the_motion():
    pose, skeleton = find_pose("expmap-full"), find_skeleton("trinity")
    rotvecs = np.random.default_rng(0).normal(size=(30, len(skeleton), 3)).cumsum(0) * 0.01
    rotations = quat_multiply(np.broadcast_to(skeleton.rest, (30, len(skeleton), 4)), rotvec_to_quat(rotvecs))
    motion = Motion(20.0, rotations, np.broadcast_to(skeleton.offsets[0], (30, 3)).copy(), skeleton=skeleton)
    moving = Sample(
        "a", 20.0, positions=motion.positions(), rotations=np.asarray(motion.rotations, float), names=skeleton.names
    )
    assert np.allclose(vectors_of(moving, pose, 20.0), pose.encode(motion), atol=1e-6)


@pytest.mark.parametrize(
    ("pose", "fps", "given"),
    [
        ("direction-vectors", 20.0, sample(0)),
        ("keypoints2d", FPS, sample(0)),
        ("expmap-upper", FPS, sample(0)),
        ("expmap-upper", FPS, Sample("b", FPS, positions=np.zeros((3, 1, 3)), rotations=np.ones((3, 1, 4)), names=("no",))),
    ],
)
def test_recordings_of_another_kind_are_refused(pose, fps, given):
    with pytest.raises(InputError, match="feature network"):
        vectors_of(given, find_pose(pose), fps)


def test_what_is_no_feature_network_is_refused():
    mean, std = np.zeros(27), np.ones(27)
    about = {"name": "x", "pose": "direction-vectors", "fps": FPS}
    net = FgdAutoencoder(FgdConfig(), pose=27)
    with pytest.raises(InputError, match="no feature network"):
        feature_net(torch.nn.Linear(2, 2), mean=mean, std=std, **about)
    with pytest.raises(InputError, match="statistics"):
        feature_net(net, mean=mean[:3], std=std, **about)
    with pytest.raises(InputError, match="statistics"):
        feature_net(net, mean=mean, std=0 * std, **about)
    with pytest.raises(InputError, match="26 numbers"):
        feature_net(FgdAutoencoder(FgdConfig(), pose=26), mean=mean, std=std, **about)


def test_omega_sees_five_frames_and_can_use_statistics_of_the_batch_as_the_authors_do():
    torch.manual_seed(0)
    net = GestureAutoencoder(AutoencoderConfig(width=8), pose=4).eval()
    x = torch.randn(2, 20, 4)
    other = x.clone()
    other[:, 10] += 1
    frames = (net.omega(x) != net.omega(other)).any(-1).any(0).nonzero().flatten()
    assert frames.tolist() == [8, 9, 10, 11, 12]
    theirs = GestureAutoencoder(AutoencoderConfig(width=8, batch_statistics=True), pose=4).eval()
    theirs.load_state_dict(net.state_dict())
    before = {key: value.clone() for key, value in theirs.state_dict().items()}
    assert torch.allclose(theirs.omega(x), net.train().omega(x), atol=1e-6)
    assert all(torch.equal(before[key], value) for key, value in theirs.state_dict().items())


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run folder of a feature network: nothing learnt, statistics of noise."""
    folder = tmp_path_factory.mktemp("run")
    config = FgdConfig(channels=4, hidden=16, code=4)
    facts = {"model": "fgd-autoencoder", "config": asdict(config), "sizes": {"pose": 27}, "needs": {}}
    write_facts(
        folder,
        facts | {"store": {"pose": "direction-vectors", "fps": FPS}},
        {"statistics": {"pose_mean": torch.zeros(27), "pose_std": torch.ones(27)}},
    )
    torch.manual_seed(0)
    write_tensors(folder / "best.safetensors", FgdAutoencoder(config, pose=27).state_dict(), {})
    return folder


def recordings(fps: float = FPS) -> list[Clip]:
    pose = find_pose("direction-vectors")
    return [Clip(f"clip{k}", "a", "ted", points=pose.decode(walk(k), fps)) for k in range(4)]


def test_evaluate_takes_the_folder_of_a_run(run):
    table = cospeech_evaluate(None, recordings(), metrics=["fgd"], features=run)
    assert "features: fgd-autoencoder " in table.about
    assert table.cells["ground truth"]["fgd"].value < 1e-9 < table.cells["frozen pose"]["fgd"].value
    again = cospeech_evaluate(None, recordings(), metrics=["fgd"], features=load_features(run))
    assert again.cells["frozen pose"]["fgd"].value == table.cells["frozen pose"]["fgd"].value
    assert cospeech_evaluate(None, recordings(), metrics=["fgd"]).about != table.about


def test_the_command_evaluate_takes_it_too(run, tmp_path):
    pose = find_pose("direction-vectors")
    entries = [
        Piece(
            Entry(f"c{k}", "a", "test", 0, 120, 0.0, ("pose",)),
            (),
            lambda k=k: {"pose": pose.encode(recordings()[k].points).astype(np.float32)},
        )
        for k in range(3)
    ]
    write_store(tmp_path / "s", entries, corpus="ted", pose=pose.name, fps=FPS, names={"pose": pose.names})
    app = typer.Typer()
    app.callback()(lambda: None)
    register(app)
    result = CliRunner().invoke(
        app, ["evaluate", "--corpus", str(tmp_path / "s"), "--metrics", "fgd", "--features", str(run), "--json"]
    )
    assert result.exit_code == 0, result.output
    assert "features: fgd-autoencoder " in json.loads(result.stdout)["about"]


def test_a_run_that_is_no_feature_network_or_another_one_is_refused(run, tmp_path):
    with pytest.raises(InputError, match="is not a run"):
        cospeech_evaluate(None, recordings(), metrics=["fgd"], features=tmp_path)
    with pytest.raises(InputError, match="made for 15"):
        cospeech_evaluate(None, recordings(20.0), metrics=["fgd"], features=run)
    for name in ("best.safetensors", "statistics.safetensors"):
        shutil.copytree(run, tmp_path / name)
        (tmp_path / name / name).write_bytes(b"nothing")
        with pytest.raises(InputError, match="damaged"):
            load_features(tmp_path / name)


def test_without_torch_it_says_what_to_install(run, monkeypatch):
    monkeypatch.delitem(sys.modules, "cospeech.models.feature_net")
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(InputError, match=r"need torch.*\.\[train\]"):
        cospeech_evaluate(None, recordings(), metrics=["fgd"], features=run)
