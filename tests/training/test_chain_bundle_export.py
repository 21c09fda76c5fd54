"""From a store with words, faces and moods to a bundle of a network of many inputs: what it plays, what no bundle can hold."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch (the train extra)")
pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.audio.features.frames import AUDIO_NAMES, audio_features  # noqa: E402
from cospeech.audio.speech import Speech, example  # noqa: E402
from cospeech.corpora.store import Store  # noqa: E402
from cospeech.corpora.store_files import Entry  # noqa: E402
from cospeech.corpora.store_writer import Piece, write_store  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.motion.motion import Motion  # noqa: E402
from cospeech.motion.poses import find_pose  # noqa: E402
from cospeech.rules import RuleBasedModel  # noqa: E402
from cospeech.runtime.bundles.spec import VOICE  # noqa: E402
from cospeech.runtime.model import TrainedModel  # noqa: E402
from cospeech.training.checkpoint import load_run, read_tensors  # noqa: E402
from cospeech.training.export.bundles import EXAMPLES, bundle_run  # noqa: E402
from cospeech.training.recipe import read_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402
from tests.support.runtime_bundles import cut, same  # noqa: E402

FPS = 12.0
_SMALL = {"frames": 16, "hidden": 8, "layers": 1, "word_width": 5}
_CHAIN = _SMALL | {"latent": 8, "reduction": 4, "text_channels": 6, "classifier_channels": 6, "classifier_steps": 2, "noise": 2}
_CHAIN |= {"seed_dropout": 0.5, "face_teacher_forcing": 0.5, "gesture_features": 5}
_LIVE = {name: value for name, value in _CHAIN.items() if name not in ("seed_dropout", "face_teacher_forcing")} | {
    "look_ahead": 3
}
_MANY = _SMALL | {"audio": 8, "text": 8, "face": 6}
MODELS = {
    "chain-of-generation-extended": _CHAIN, "chain-of-generation-live": _LIVE, "camn": _MANY | {"semantic": False},
    "multi-context": _MANY | {"emotion": 4},
    "audio2gestures": {"frames": 16, "channels": 16, "code": 3},
    "gesticulator": {"frames": 9, "history": 3, "look_ahead": 4, "hidden": 8, "context": 9, "speech": 4, "word_width": 5},
}  # fmt: skip
JUDGES, NOISY = {"chain-of-generation-extended", "chain-of-generation-live"}, {*MODELS} - {"camn", "gesticulator"}
LIVE = {"chain-of-generation-live", "gesticulator"}


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Two speakers of our rules (synthetic), in two moods."""
    folder = tmp_path_factory.mktemp("store")
    speech, pose, pieces = Speech.load(example()[0]).window(0, 6), find_pose("expmap-humanoid"), []
    for k, (name, style, split) in enumerate([("big", "lively", "train"), ("small", "reserved", "train")] * 2):
        motion = RuleBasedModel().generate(speech, style=style, seed=k, fps=FPS)
        values = {
            "pose": pose.encode(motion).astype(np.float32), "audio": audio_features(speech, len(motion), FPS),
            "face": motion.face.astype(np.float32), "emotion": np.full(len(motion), k, np.int8),
            "word": (np.arange(len(motion)) // 9 % 3).astype(np.int32),
        }  # fmt: skip
        entry = Entry(f"{name}{k}", name, "validation" if k > 1 else split, 0, len(motion), 0.0, tuple(values))
        pieces.append(Piece(entry, ("yes", "mountains"), lambda values=values: dict(values)))
    names = {"pose": pose.names, "audio": AUDIO_NAMES, "face": tuple(map(str, range(52)))}
    write_store(folder, pieces, corpus="beat", pose="expmap-humanoid", fps=FPS, names=names)
    return Store(folder)


def trained(store, folder, name, data=None, config=None, **needs):
    """A run of a few steps."""
    settings = {"steps": 5, "batch": 4, "threads": 1, "device": "cpu", "validate_every": 5, "save_every": 5}
    sections = {
        "model": {"name": name, **MODELS[name], **(config or {})},
        "needs": needs,
        "data": {"audio": "mel20-prosody", **(data or {})},
    }
    train(read_recipe(sections | {"train": settings}), store, folder)
    return folder


@pytest.fixture(scope="module")
def run_of(store, tmp_path_factory):
    """Make a run of each model, once."""
    folder, runs = tmp_path_factory.mktemp("runs"), {}

    def run(name):
        if name not in runs:
            needs = {"teacher": str(run("chain-of-generation-extended"))} if name.endswith("live") else {}
            runs[name] = trained(store, folder / name, name, **needs)
        return runs[name]

    return run


@pytest.fixture(scope="module")
def player_of(run_of):
    """Make a bundle of each run, once, and open it."""
    players = {}

    def player(name):
        if name not in players:
            path = run_of(name).parent / f"{name}.cospeech"
            bundle_run(run_of(name), path)
            players[name] = TrainedModel.open(path)
        return players[name]

    return player


@pytest.mark.parametrize("name", MODELS)
def test_a_run_becomes_a_bundle_that_plays_as_speech_comes_what_it_plays_at_once(player_of, name):
    player, speech = player_of(name), Speech.load(example()[0]).window(0, 2)
    system = player.system
    assert system.styles == (("big", "small", VOICE) if name in JUDGES else ("big", "small"))
    assert player.default_style == (VOICE if name in JUDGES else "big")
    assert (system.fps, system.pose, "classify" in system.networks) == (FPS, "expmap-humanoid", name in JUDGES)
    assert ("live" in system.networks) == (name in LIVE)
    assert name == "audio2gestures" or system.statistics.words.shape[1] == 5
    for look_ahead in (None, inf):
        options = {"seed": 2, "look_ahead": look_ahead, "parts": ("body", "hands")}
        takes = player.generate_takes(speech, takes=2, **options)
        assert len(takes[0]) == speech.frames(30.0)
        assert np.isfinite(takes[0].rotations).all()
        assert same(*takes) is (name not in NOISY)
        for edges in ([], [1, 7, 9000, 20_000]):
            assert same(Motion.concatenate(list(player.stream(cut(speech, edges), **options))), takes[0])


@pytest.mark.parametrize("name", [name for name in MODELS if name not in ("gesticulator", "audio2gestures")])
def test_a_bundle_makes_what_its_network_makes(run_of, name, tmp_path):
    """They are equal where weights are exact; in half precision they differ by the rounding that the manifest gives."""
    bundle_run(run_of(name), tmp_path / "it.cospeech", small=False, style="small")
    player, net = TrainedModel.open(tmp_path / "it.cospeech"), load_run(run_of(name))[0]
    system, whole = player.system, getattr(net, "teacher", net)
    assert player.default_style == "small"
    examples, _ = read_tensors(run_of(name) / EXAMPLES)
    rng, who = np.random.default_rng(0), system.networks["make"]
    texts = examples["texts"][0, 0, :40].long()
    words = whole.words(texts[None])[0].detach().numpy()
    rows = np.concatenate([examples["speech"][0, 0, :40].numpy(), words], 1)
    style, noise = (
        rng.uniform(size=(2, 40, width)).astype(np.float32) for width in map(who.signature.width, ("style", "noise"))
    )
    speech, *others = (torch.from_numpy(np.broadcast_to(x, (2, *x.shape[-2:])).copy()) for x in (rows, style, noise))
    with torch.no_grad():
        expected = whole.make(speech, *others).numpy().clip(*system.statistics.bounds)
    ports = {"style": style} | ({"noise": noise} if noise.size else {})
    np.testing.assert_allclose(who.run(rows=rows[None], **ports)["poses"], expected, atol=1e-4)
    assert not system.statistics.words[0].any()
    np.testing.assert_allclose(system.word_rows(["yes", None])[1], 0)


def test_a_bundle_of_gesticulator_makes_what_its_network_makes(run_of, player_of):
    """It plays by frames alone; before the first frame there are zeros."""
    net, who = load_run(run_of("gesticulator"))[0], player_of("gesticulator").system.networks["live"]
    assert set(player_of("gesticulator").system.networks) == {"live"}
    assert who.signature.look_ahead == net.config.look_ahead
    rows = torch.randn(20, net.rows, generator=torch.Generator().manual_seed(0))
    rows[:, net.audio :] = rows[torch.arange(20) // 4 * 4, net.audio :]  # a word for four frames
    before = torch.zeros(net.length - 1, net.rows)
    with torch.no_grad():
        expected = net(torch.cat([before, rows])[None], torch.zeros(1, net.config.poses * net.pose))[0].numpy()
    state, poses = who.begin(1), []
    for row in rows.numpy():
        output = who.run(rows=row[None], **state)
        state = {name: output[f"next.{name}"] for name in state}
        poses.append(output["poses"][0])
    np.testing.assert_allclose(poses, expected, atol=2e-3)  # weights are of 16 bits


def test_by_how_much_noise_is_multiplied_is_measured(player_of):
    for name in MODELS:
        noise_gain = player_of(name).system.statistics.noise_gain
        assert noise_gain.shape == (2,)
        assert ((noise_gain >= 1) & (noise_gain <= 5)).all()
        assert name in NOISY or (noise_gain == 1).all()


def test_a_run_on_words_of_others_is_no_bundle(store, tmp_path):
    (tmp_path / "words.vec").write_text("2 3\nyes 0.1 0.2 0.3\nmountains 0.3 -0.2 0.1\n", "utf-8")
    run = trained(store, tmp_path / "vectors", "camn", {"words": str(tmp_path / "words.vec")})
    with pytest.raises(InputError, match="word vectors"):
        bundle_run(run, tmp_path / "it.cospeech")
    assert not (tmp_path / "it.cospeech").exists()


@pytest.mark.parametrize("part", ["attention", "style_injection"])
def test_a_row_of_a_table_is_no_system(store, tmp_path, part):
    run = trained(store, tmp_path / "run", "chain-of-generation-extended", config={part: False})
    with pytest.raises(InputError, match="lacks attention or style"):
        bundle_run(run, tmp_path / "x.cospeech", which="last")
    assert not (tmp_path / "x.cospeech").exists()
