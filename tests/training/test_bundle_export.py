"""From a store to a bundle that plays: poses by their recording's own moments, styles of speakers, what ships."""

from __future__ import annotations

import json
import shutil
import zipfile

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch (the train extra)")

import cospeech  # noqa: E402
from cospeech.audio.features.frames import AUDIO_NAMES, audio_features  # noqa: E402
from cospeech.audio.speech import Speech, example  # noqa: E402
from cospeech.corpora.store import Store  # noqa: E402
from cospeech.corpora.store_files import Entry  # noqa: E402
from cospeech.corpora.store_writer import Piece, write_store  # noqa: E402
from cospeech.errors import CospeechWarning, InputError  # noqa: E402
from cospeech.metrics.movement import Track  # noqa: E402
from cospeech.models import SHIPPED  # noqa: E402
from cospeech.motion.poses import find_pose  # noqa: E402
from cospeech.motion.skeletons.arkit import ARKIT_INDEX  # noqa: E402
from cospeech.rules import RuleBasedModel  # noqa: E402
from cospeech.runtime.bundles.bundle import read_bundle  # noqa: E402
from cospeech.runtime.model import TrainedModel  # noqa: E402
from cospeech.runtime.system import open_bundle  # noqa: E402
from cospeech.training.batch_loader import SPREAD_FLOOR, BatchLoader, clip_moments, standard_audio, standard_pose  # noqa: E402
from cospeech.training.calibration_clips import STRETCH, STRETCHES, examples_of  # noqa: E402
from cospeech.training.checkpoint import load_run, read_tensors, write_tensors  # noqa: E402
from cospeech.training.export.bundles import EXAMPLES, bundle_run  # noqa: E402
from cospeech.training.recipe import read_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402
from cospeech.training.windows import Windows  # noqa: E402

FPS = 12.0
MODEL = {
    "steps": 2, "hidden": 8, "history": 4, "look_ahead": 2, "frames": 8, "encoder_channels": 8, "encoder_blocks": 1,
    "style": 4, "style_window": 16, "residual": True, "inertia": 0.7, "steps_seen": True, "reconstruct_every": 5,
}  # fmt: skip


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Two speakers of our rules: one large and lively, one small; the second stands further to the side."""
    folder = tmp_path_factory.mktemp("bundling") / "store"
    speech = Speech.load(example()[0]).window(0, 8)
    pose, pieces = find_pose("expmap-humanoid"), []
    for k, (name, style, size) in enumerate([("big", "lively", 1.0), ("small", "reserved", 0.6)] * 3):
        motion = RuleBasedModel().generate(speech, style=style, intensity=size, seed=k, fps=FPS, parts=("body", "hands"))
        vectors = pose.encode(motion).astype(np.float32)
        vectors[:, pose.names.index("hips.x")] += 0.2 * (name == "small")
        rows = audio_features(speech, len(vectors), FPS)
        values = {"pose": vectors, "audio": rows}
        entry = Entry(f"{name}{k}", name, "validation" if k > 3 else "train", 0, len(vectors), 0.0, ("pose", "audio"))
        pieces.append(Piece(entry, (), lambda values=values: dict(values)))
    names = {"pose": pose.names, "audio": AUDIO_NAMES}
    write_store(folder, pieces, corpus="folder", pose="expmap-humanoid", fps=FPS, names=names)
    return Store(folder)


@pytest.fixture(scope="module")
def run(store, tmp_path_factory):
    """A short run."""
    recipe = {
        "model": {"name": "stylised-flow-extended", **MODEL},
        "data": {"audio": "mel20-prosody", "per_clip_normalisation": True},
        "train": {
            "steps": 150,
            "batch": 16,
            "lr": 3e-3,
            "threads": 1,
            "device": "cpu",
            "validate_every": 150,
            "save_every": 150,
        },
    }
    folder = tmp_path_factory.mktemp("bundling") / "run"
    train(read_recipe(recipe), store, folder)
    return folder


@pytest.fixture(scope="module")
def bundle(run):
    path = run.parent / "it.cospeech"
    bundle_run(run, path)
    return path


def test_by_clip_every_clip_has_mean_0_and_deviation_1_or_less(store):
    pose = standard_pose(store)
    moments = clip_moments(store, pose)
    feed = BatchLoader(Windows(store, 90), {"pose": pose}, None, moments)
    plain = BatchLoader(Windows(store, 90), {"pose": pose}, None)
    for step in range(3):
        batch, raw = feed.at(4, 0, step), plain.at(4, 0, step)
        number = batch["clip"][0]
        back = batch["pose"][0] * moments.spread[number] + moments.centre[number]
        np.testing.assert_allclose(back, raw["pose"][0], atol=1e-5)
    for number, clip in enumerate(store.clips):
        whole = moments(pose(store.clip(clip)["pose"])[None], np.array([number]))[0]
        assert np.abs(whole.mean(0)).max() < 1e-4
        is_still = moments.spread[number] <= SPREAD_FLOOR
        np.testing.assert_allclose(whole.std(0)[~is_still], 1, atol=1e-3)
        assert (whole.std(0)[is_still] <= 1 + 1e-4).all()


def test_what_a_run_keeps_of_its_data(store):
    pose = standard_pose(store)
    audio = standard_audio(store, None)
    plain, own = (examples_of(store, pose, audio, None, m) for m in (None, clip_moments(store, pose)))
    assert plain["stretches"].shape == own["stretches"].shape == (2, STRETCHES, STRETCH, 57)
    assert "pose_spread" not in plain
    assert own["pose_spread"].shape == (2, 57)
    side = find_pose("expmap-humanoid").names.index("hips.x")
    apart = (own["pose_centre"][1] - own["pose_centre"][0]) * pose.std
    assert 0.1 < apart[side] < 0.3  # metres
    assert own["pose_spread"][0].mean() > own["pose_spread"][1].mean()
    assert (own["pose_low"] < 0).all()
    assert (own["pose_high"] > 0).all()


def test_a_bundle_has_size_and_place_of_the_style_that_is_played(bundle):
    player = TrainedModel.open(bundle)
    assert player.system.styles == ("big", "small")
    speech = Speech.load(example()[0])
    big, small = (player.generate(speech, style=name, seed=2, fps=FPS, parts=("body", "hands")) for name in ("big", "small"))
    spread = [Track.of(motion).wrists.std(0).mean() for motion in (big, small)]
    assert spread[0] > 1.15 * spread[1]
    assert 0.08 < small.root[:, 0].mean() - big.root[:, 0].mean() < 0.32
    half = player.generate(speech, style="big:0.5,small:0.5", seed=2, fps=FPS, parts=("body", "hands"))
    assert big.root[:, 0].mean() < half.root[:, 0].mean() < small.root[:, 0].mean()


def test_what_is_made_has_mean_and_deviation_of_the_style(bundle):
    """A short training makes a network that strays from mean 0 and deviation 1: the bundle knows by how much."""
    player = TrainedModel.open(bundle)
    s = player.system.statistics
    assert (np.abs(s.free_mean) > 0.05).any()
    speech = Speech.load(example()[0])  # all of it: nine seconds hold few gestures
    pose, rows = find_pose("expmap-humanoid"), []
    for seed in range(6):
        motion = player.generate(speech, style="big", seed=seed, fps=FPS, parts=("body", "hands"))
        rows.append(pose.encode(motion)[24:])
    poses = (np.concatenate(rows) - s.pose_mean) / s.pose_std
    arms = [k for k, name in enumerate(pose.names) if "Arm" in name]
    off = np.abs(poses.mean(0) - s.speaker_mean[0])[arms] / s.speaker_std[0][arms]
    ratio = poses.std(0)[arms] / s.speaker_std[0][arms]
    assert off.mean() < 0.4
    assert 0.7 < np.median(ratio) < 1.3


def test_no_intensity_is_the_mean_pose_of_the_style(bundle):
    player = TrainedModel.open(bundle)
    speech = Speech.load(example()[0]).window(0, 2)
    still = player.generate(speech, style="small", intensity=0, fps=FPS, parts=("body",))
    statistics = player.system.statistics
    expected = find_pose("expmap-humanoid").decode(
        (statistics.speaker_mean[1] * statistics.pose_std + statistics.pose_mean)[None], FPS
    )
    body = [k for k in range(len(still.skeleton)) if k not in (*still.skeleton.left_hand, *still.skeleton.right_hand)]
    np.testing.assert_allclose(np.abs((still.rotations[:, body] * expected.rotations[0, body]).sum(-1)), 1, atol=1e-5)


def test_a_run_folder_and_its_bundle_play_the_same(run, bundle):
    speech = Speech.load(example()[0]).window(0, 2)
    first, second = (cospeech.load(str(path)).generate(speech, seed=5) for path in (run, bundle))
    assert first.rotations.tobytes() == second.rotations.tobytes()
    model, _ = load_run(run)
    assert model.stylist is not None


def card(path):
    with zipfile.ZipFile(path) as archive:
        return archive.read("card.md").decode()


def check_progress(reports, *words):
    """Every step of the work is reported, and each that has an end reaches it."""
    assert tuple(dict.fromkeys(word for *_, word in reports)) == words
    for word in words[1:]:
        rows = [(step, total) for step, total, what in reports if what == word]
        assert rows == [(step, rows[0][1]) for step in range(1, len(rows) + 1)]
        assert len(rows) == rows[0][1]


def test_a_run_without_a_validation_yet_can_be_bundled_and_says_so(run, tmp_path):
    early = tmp_path / "early"
    shutil.copytree(run, early)
    (early / "best.safetensors").unlink()
    with pytest.warns(CospeechWarning, match="its last parameters are taken, of step"):
        bundle_run(early, tmp_path / "early.cospeech")
    assert "The last parameters, not the best" in card(tmp_path / "early.cospeech")
    reports = []
    bundle_run(run, tmp_path / "last.cospeech", which="last", progress=lambda *row: reports.append(row))
    check_progress(reports, "exporting the networks", "measuring how it moves by itself")
    assert "not the best" not in card(tmp_path / "last.cospeech")
    with pytest.warns(CospeechWarning, match="its last parameters are taken, of step"):
        cospeech.load(str(early))


MIX = {"name": "mix-stage", "modes": 3, "channels": 8, "depth": 3, "style": 3, "patch_channels": 4}
S2G = {"name": "speech2gesture", "channels": 8, "depth": 3, "decoder": 1, "discriminator_channels": 4}
MUNIT = {"name": "munit", "channels": 4, "style": 2, "mlp": 8, "blocks": 1}


@pytest.fixture(scope="module")
def window_run(store, tmp_path_factory):
    """Makes runs of a few steps of networks by windows, each once."""
    folder, paths = tmp_path_factory.mktemp("windowed"), set()

    def run_of(model, **data):
        if (path := folder / "-".join([model["name"], *data])) not in paths:
            settings = {"steps": 4, "batch": 4, "threads": 1, "device": "cpu", "validate_every": 4, "save_every": 4}
            recipe = {"model": model, "data": {"audio": "mel20-prosody", **data}, "train": settings}
            train(read_recipe(recipe), store, path)
            paths.add(path)
        return path

    return run_of


@pytest.mark.parametrize("model", [MIX, S2G, MUNIT], ids=lambda model: model["name"])
def test_a_network_by_windows_plays_without_torch_what_it_makes_with_it(window_run, model, tmp_path):
    folder, path = window_run(model), tmp_path / "it.cospeech"
    bundle_run(folder, path, small=False, style="small")
    system, (net, _) = open_bundle(path), load_run(folder)
    assert (system.styles, system.style, system.fps, system.pose) == (("big", "small"), "small", FPS, "expmap-humanoid")
    examples, _ = read_tensors(folder / EXAMPLES)
    codes = net.speaker_styles(examples["stretches"])
    np.testing.assert_array_equal(system.statistics.style_codes, codes)
    if model is MIX:
        np.testing.assert_array_equal(codes, np.eye(2))
    for code, speech in zip(codes, examples["speech"][:, 0, :96], strict=True):
        expected = net.generate(speech[None], code[None, None])[0].numpy()
        style = {"style": np.broadcast_to(code.numpy(), (1, 96, net.styles))} if net.styles else {}
        rows = system.main_network.run(rows=speech.numpy()[None], **style)["poses"][0]
        expected = expected.clip(*system.statistics.bounds)
        np.testing.assert_allclose(rows, expected, atol=1e-4)
    for which, value in vars(system.statistics).items():
        if which in examples:
            np.testing.assert_array_equal(value, examples[which])


def test_half_precision_is_smaller_and_says_what_it_costs(window_run, tmp_path):
    sizes, reports = [], []
    for small, progress in ((True, lambda *row: reports.append(row)), (False, None)):
        path = tmp_path / f"{small}.cospeech"
        bundle_run(window_run(MIX), path, small=small, progress=progress)
        sizes.append(path.stat().st_size)
    check_progress(reports, "exporting the networks", "measuring how it moves", "rounding the weights")
    assert sizes[0] < 0.8 * sizes[1]
    rounding = read_bundle(tmp_path / "True.cospeech").manifest["rounding"]
    assert 0 < rounding < 0.01
    systems = [open_bundle(tmp_path / f"{small}.cospeech") for small in (True, False)]
    examples, _ = read_tensors(window_run(MIX) / EXAMPLES)
    rows = examples["speech"][0].flatten(0, 1).numpy()
    style = np.eye(2, dtype=np.float32)[None, [0] * len(rows)]
    small, exact = (system.main_network.run(rows=rows[None], style=style)["poses"] for system in systems)
    assert np.linalg.norm(small - exact) / np.linalg.norm(exact) == pytest.approx(rounding, rel=0.5)
    assert "rounding" not in read_bundle(tmp_path / "False.cospeech").manifest
    assert "half precision" in systems[0].card


def test_a_run_by_windows_is_on_stage(window_run):
    speech = Speech.load(example()[0]).window(0, 3)
    player = cospeech.load(str(window_run(MIX)))
    first, again, other = (player.generate(speech, style=name, seed=1, fps=FPS) for name in ("big", "big", "small"))
    assert first.rotations.tobytes() == again.rotations.tobytes()
    assert len(first) == 36
    assert np.abs(first.rotations - other.rotations).max() > 0


def test_poses_by_clip_are_not_for_networks_by_windows(window_run, tmp_path):
    with pytest.raises(InputError, match="per_clip_normalisation"):
        bundle_run(window_run(S2G, per_clip_normalisation=True), tmp_path / "it.cospeech")


def test_runs_that_play_nothing_and_names_that_are_none(run, tmp_path):
    with pytest.raises(InputError, match=r"ends in \.cospeech"):
        bundle_run(run, tmp_path / "it.zip")
    with pytest.raises(InputError, match="not a run"):
        bundle_run(tmp_path, tmp_path / "it.cospeech")
    with pytest.raises(InputError, match="no weights of 'moglow' ship"):
        cospeech.load("moglow")
    early = shutil.copytree(run, tmp_path / "early")  # before the speech was kept
    tensors, _ = read_tensors(run / EXAMPLES)
    write_tensors(early / EXAMPLES, {name: tensor for name, tensor in tensors.items() if name != "speech"}, {})
    with pytest.raises(InputError, match="of another version"):
        bundle_run(early, tmp_path / "it.cospeech")
    assert not list(tmp_path.glob("*.cospeech"))


LARGEST = {"chain-of-generation": 8_000_000}
"""Bytes, of what holds two networks."""
SPEAKING = SHIPPED / "speech-to-face.cospeech"


@pytest.mark.parametrize("path", sorted({*SHIPPED.glob("*.cospeech")} - {SPEAKING}), ids=lambda path: path.stem)
def test_what_ships_is_small_says_what_it_is_and_moves(path):
    assert path.stat().st_size <= LARGEST.get(path.stem, 5_000_000)
    with zipfile.ZipFile(path) as file:
        manifest, card = json.loads(file.read("bundle.json")), file.read("card.md").decode()
    model = manifest["model"].removesuffix("-extended")
    assert model.removesuffix("-live") == path.stem  # of two networks the one that streams
    assert (
        manifest.get("flow", {}).get("int8") or 0 < manifest["rounding"] < 0.01
    )  # of a flow; of a network by windows, 16 bits
    for word in ("synthetic", "cannot do", "Rebuild", "±", "ground truth", "noise", "frozen"):
        assert word in card, word
    player = cospeech.load(path.stem)
    speech = Speech.load(example()[0])
    motions = {
        style: player.generate(speech, style=style, seed=0, parts=("body", "hands")) for style in player.system.styles[:3]
    }
    for motion in motions.values():
        track = Track.of(motion)
        speed = np.linalg.norm(np.diff(track.wrists, axis=0), axis=-1) * track.fps
        assert 0.05 < speed.mean() < 1.0  # metres per second: people who talk
        assert speed.max() < 6
    first, second, _ = motions.values()
    assert np.abs(first.rotations - second.rotations).max() > 0.1


def test_the_face_that_ships_names_whom_it_learnt_from_and_talks():
    assert SPEAKING.stat().st_size <= 4_000_000
    with zipfile.ZipFile(SPEAKING) as file:
        manifest, card = json.loads(file.read("bundle.json")), file.read("card.md").decode()
    assert (manifest["model"], manifest["pose"], manifest["style"]) == ("speech-to-face", "face", "grid_s1")
    assert 0 < manifest["rounding"] < 0.01
    for word in ("CC BY 4.0", "Cooke", "FACEGOOD", "MIT", "cannot do", "Rebuild", "regression"):
        assert word in card, word
    assert "| channels whose deviation is .6 to 1.3 of the tracked | 11 of 11 | 13 of 15 |" in card
    assert "| of those about the mean of each clip | 11 of 11 | 15 of 15 |" in card
    player, speech = cospeech.load("speech-to-face"), Speech.load(example()[0])
    motion = player.generate(speech, fps=60)
    jaw = motion.face[:, ARKIT_INDEX["jawOpen"]]
    assert 0.03 < jaw.std() < 0.3
    assert jaw.max() < 0.9
    silence = player.generate(Speech(np.zeros(16_000, np.float32)), fps=60)
    assert not silence.face[:, ARKIT_INDEX["jawOpen"]].any()
    still = [k for k, name in enumerate(motion.skeleton.names) if name not in ("neck", "head", "leftEye", "rightEye")]
    assert np.ptp(motion.rotations[:, still], 0).max() == 0
