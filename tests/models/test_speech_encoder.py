"""wav2vec 2.0 against transformers' own, with small random weights: nothing is downloaded."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
transformers = pytest.importorskip("transformers")

from huggingface_hub.errors import HFValidationError  # noqa: E402

from cospeech.audio.speech import Speech  # noqa: E402
from cospeech.corpora.beat import read as beat  # noqa: E402
from cospeech.corpora.clip import Clip  # noqa: E402
from cospeech.corpora.prepare import prepare  # noqa: E402
from cospeech.corpora.store import Store  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.models.chain_live import ChainLive, ChainLiveConfig  # noqa: E402
from cospeech.models.chain_of_generation import ChainConfig, ChainOfGeneration  # noqa: E402
from cospeech.models.nn.speech_encoder import load_cnn, load_transformer  # noqa: E402
from cospeech.rules import EMOTIONS  # noqa: E402
from cospeech.training.checkpoint import load_run  # noqa: E402
from cospeech.training.export.bundles import bundle_run  # noqa: E402
from cospeech.training.recipe import SHIPPED, load_recipe, read_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402
from tests.corpora.test_prepare import moving, voice  # noqa: E402

RECIPE = SHIPPED / "chain_of_generation_beat_wav2vec.toml"
SMALL = {
    "hidden_size": 24, "num_hidden_layers": 2, "num_attention_heads": 2, "intermediate_size": 32, "conv_dim": (16,) * 7,
    "num_conv_pos_embeddings": 8, "num_conv_pos_embedding_groups": 2, "layerdrop": 0.5, "mask_time_prob": 0.5,
}  # fmt: skip
KINDS = {"base": {}, "large": {"feat_extract_norm": "layer", "do_stable_layer_norm": True, "conv_bias": True}}


def make(folder: Path, **changes) -> str:
    """A folder of random weights, as a fine-tuned model is published: with a head that nobody needs."""
    torch.manual_seed(0)
    model = transformers.Wav2Vec2ForCTC(transformers.Wav2Vec2Config(**SMALL | changes))
    with torch.no_grad():
        for parameter in model.parameters():
            parameter.add_(0.05 * torch.randn_like(parameter))
    transformers.utils.logging.disable_progress_bar()
    model.save_pretrained(folder)
    return str(folder)


@pytest.fixture(scope="module", params=KINDS)
def model_folder(request, tmp_path_factory) -> str:
    return make(tmp_path_factory.mktemp("pretrained") / request.param, **KINDS[request.param])


@pytest.fixture(scope="module")
def base(tmp_path_factory) -> str:
    return make(tmp_path_factory.mktemp("pretrained") / "tiny-base")


def reference(name: str, samples: np.ndarray):
    """Output of the package transformers, which normalises samples itself: (K, 16) features, (K, 24) states."""
    extractor = transformers.Wav2Vec2FeatureExtractor()
    values = extractor(samples, sampling_rate=16_000, return_tensors="pt").input_values
    model = transformers.Wav2Vec2Model.from_pretrained(name).eval()
    with torch.no_grad():
        return model.feature_extractor(values)[0].T.numpy(), model(values).last_hidden_state[0].numpy()


def sound(count: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (0.1 * rng.normal(size=count) * (1 + np.sin(np.arange(count) / 9000)) + 0.02).astype(np.float32)


@pytest.mark.parametrize("count", [400, 36_266, 16_000 * 23])
def test_it_hears_what_transformers_hears(model_folder, count):
    samples = sound(count)
    features, states = reference(model_folder, samples)
    output = load_cnn(model_folder).hear(torch.from_numpy(samples)[None])
    np.testing.assert_allclose(output[0].T, features, atol=2e-5)
    with torch.no_grad():
        hidden = load_transformer(model_folder).eval()(output.mT)[0]
    np.testing.assert_allclose(hidden, states, atol=2e-4)


def test_a_window_of_34_frames(base):
    cnn, samples = load_cnn(base), np.stack([sound(36_266, k) for k in range(2)])
    assert (cnn.stride, cnn.field, cnn.width) == (320, 400, 16)
    rows = cnn(torch.from_numpy(samples), 34)
    assert rows.shape == (2, 34, 16)
    features, _ = reference(base, samples[1])
    assert len(features) == 113
    at = np.linspace(0, 112, 34)
    expected = np.stack([np.interp(at, np.arange(113), column) for column in features.T], 1)
    np.testing.assert_allclose(rows[1], expected, atol=2e-5)
    assert load_transformer(base)(rows).shape == (2, 34, 24)


def test_frames_have_the_features_of_their_times(base):
    samples, frames = sound(16_000 * 13), 15 * 13
    features, _ = reference(base, samples)
    middle = (np.arange(len(features)) * 320 + 199.5) / 16_000
    expected = np.stack([np.interp(np.arange(frames) / 15, middle, column) for column in features.T], 1)
    rows = load_cnn(base).frame_features(Speech(samples), frames, 15.0)
    assert rows.shape == (frames, 16)
    assert rows.dtype == np.float16
    np.testing.assert_allclose(rows, expected, atol=2e-3, rtol=2e-3)


def test_any_rate_and_any_length_is_heard(base):
    cnn = load_cnn(base)
    fine, coarse = (cnn.frame_features(Speech(tone(rate), rate), 30, 15.0).astype(float) for rate in (48_000, 16_000))
    assert np.corrcoef(fine.ravel(), coarse.ravel())[0, 1] > 0.98
    assert np.isfinite(cnn.frame_features(Speech(np.zeros(10, np.float32)), 1, 15.0)).all()
    assert np.isfinite(cnn.frame_features(Speech(np.zeros(16_000, np.float32)), 15, 15.0)).all()


def tone(rate: int) -> np.ndarray:
    t = np.arange(2 * rate) / rate
    return (0.2 * np.sin(2 * np.pi * 200 * t) * (np.sin(5 * t) > 0) + 0.1 * np.sin(2 * np.pi * 730 * t)).astype(np.float32)


def test_the_transformer_draws_nothing(base):
    transformer = load_transformer(base).train()
    for module in transformer.modules():
        if isinstance(module, torch.nn.Dropout):
            module.p = 0.0
    for layer in transformer.encoder.layers:
        layer.attention.dropout = 0.0
    x = torch.randn(2, 34, 16, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(transformer(x), transformer(x))


def wrong(folder: Path, what: str) -> str:
    if what == "nothing":
        return str(folder / "none")
    if what == "bert":
        transformers.BertConfig().save_pretrained(folder)
    if what == "no weights":
        transformers.Wav2Vec2Config(**SMALL).save_pretrained(folder)
    if what == "cut off":
        path = Path(make(folder)) / "model.safetensors"
        path.write_bytes(path.read_bytes()[:5000])
    if what in ("layer missing", "other sizes"):
        path = Path(make(folder)) / "config.json"
        change = {"num_hidden_layers": 3} if what == "layer missing" else {"intermediate_size": 48}
        path.write_text(json.dumps(json.loads(path.read_text()) | change))
    if what == "no json":
        folder.mkdir(exist_ok=True)
        (folder / "config.json").write_text("{")
    return str(folder)


@pytest.mark.parametrize("what", ["nothing", "bert", "no weights", "cut off", "layer missing", "other sizes", "no json"])
def test_what_cannot_be_loaded_is_told(tmp_path, monkeypatch, what):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    with pytest.raises(InputError, match=r"wav2vec|bert") as error:
        load_transformer(wrong(tmp_path / "a", what))
    assert "\n" not in str(error.value)


def test_without_transformers_it_says_what_to_install(base, monkeypatch):
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(InputError, match=r'in a clone: pip install -e "\.\[wav2vec\]"'):
        load_transformer(base)


@pytest.fixture(scope="module")
def raw(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("raw")
    clips = []
    for k in range(4):
        face = np.random.default_rng(k).random((240, 52))
        clip = Clip(f"clip{k}", ("ann", "bob")[k % 2], "beat", voice(4.0, k), moving("beat", 4.0, 120.0, k), face=face,
                    face_fps=60.0, emotion=EMOTIONS[k % 3], split=("train", "validation")[k // 2])  # fmt: skip
        clips.append(clip)
    beat.write(clips, folder)
    return folder


@pytest.fixture(scope="module")
def store(raw, base, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("stores") / "heard"
    prepare("beat", raw, folder, fps=15, wav2vec=base, filters=False)
    return folder


def test_a_store_keeps_the_features(raw, base, store, tmp_path):
    contents = Store(store)
    assert contents.arrays["wav2vec"].dtype == np.float16
    assert contents.arrays["wav2vec"].shape == (len(contents), 16)
    assert contents.names["wav2vec"][:2] == ("tiny-base 0", "tiny-base 1")
    cnn = load_cnn(base)
    for clip in beat.read(raw):
        rows = contents.clip(clip.name)["wav2vec"]
        np.testing.assert_array_equal(rows, cnn.frame_features(clip.speech, len(rows), 15.0))
    prepare("beat", raw, tmp_path / "plain", fps=15, filters=False)
    plain = Store(tmp_path / "plain")
    assert {*contents.arrays} - {*plain.arrays} == {"wav2vec"}
    for name, array in plain.arrays.items():
        np.testing.assert_array_equal(array, contents.arrays[name])


def test_a_wrong_model_is_told_before_anything_is_read(raw, tmp_path, monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    with pytest.raises(InputError, match="cannot load wav2vec"):
        prepare("beat", raw, tmp_path / "store", wav2vec=str(tmp_path / "none"))
    assert not (tmp_path / "store").exists()


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (OSError("[Errno -2] Name or service not known"), "it is no folder, not downloaded yet, and Hugging Face's hub cannot"),
        (HFValidationError("Repo id must use alphanumeric chars"), "it is no folder, and no model on Hugging Face's hub"),
    ],
)
def test_a_name_that_cannot_be_fetched_is_told_after_one_question(monkeypatch, answer, message):
    questions: list[str] = []

    def answer_once(name: str, **_: object) -> None:
        questions.append(name)
        raise answer

    monkeypatch.setattr("huggingface_hub.model_info", answer_once)
    with pytest.raises(InputError, match=rf"^cannot load wav2vec 2\.0 from 'nosuch': {message}.* \(a folder with config\.json"):
        load_cnn("nosuch")
    assert questions == ["nosuch"]


TINY = {"latent": 8, "hidden": 8, "layers": 1, "reduction": 4, "word_width": 5, "text_channels": 6, "classifier_channels": 6}


def recipe(base: str, **model):
    sections = load_recipe(RECIPE).to_dict()
    sections["model"] |= TINY | {"encoder": base, "classifier_steps": 2} | model
    sections["train"] |= {"steps": 5, "batch": 4, "save_every": 5, "validate_every": 5, "clip_norm": 1.0}
    return read_recipe(sections)


def test_a_run_trains_the_transformer_and_not_the_cnn(base, store, tmp_path):
    before = {name: value.clone() for name, value in load_cnn(base).state_dict().items()}
    train(recipe(base), store, tmp_path / "run")
    model, facts = load_run(tmp_path / "run")
    assert model.arrays[1] == "wav2vec"
    assert facts["config"]["encoder"] == base
    began, now = load_transformer(base).state_dict(), model.speech_encoder.transformer.state_dict()
    assert {*began} == {*now}
    still = [name for name in began if began[name].is_floating_point() and torch.equal(began[name], now[name])]
    assert [name for name in still if "k_proj.bias" not in name] == []  # which softmax does not notice
    sizes = {tuple(value.shape) for value in before.values() if value.ndim == 3}
    assert not any(tuple(value.shape) in sizes for name, value in model.speech_encoder.named_parameters() if "conv" not in name)
    for name, value in load_cnn(base).state_dict().items():
        assert torch.equal(value, before[name])
    assert not any(parameter.requires_grad for parameter in load_cnn(base).parameters())


def test_a_run_plays_and_cannot_be_bundled(base, store, tmp_path):
    train(recipe(base), store, tmp_path / "run")
    model, _ = load_run(tmp_path / "run")
    rows = torch.from_numpy(Store(store).clip(0)["wav2vec"][None].astype(np.float32))
    count = rows.shape[1]
    arrays = {"wav2vec": rows, "pose": torch.zeros(1, count, 141), "text": torch.zeros(1, count, 12, dtype=torch.long)}
    assert model.eval().play(arrays)["pose"].shape == (1, count, 141)
    with pytest.raises(InputError, match="needs the speech encoder wav2vec"):
        bundle_run(tmp_path / "run", tmp_path / "a.cospeech")


def test_a_store_heard_by_another_model_is_told(store, tmp_path):
    other = make(tmp_path / "other")
    with pytest.raises(InputError, match="was heard by 'tiny-base', the recipe has 'other'"):
        train(recipe(other), store, tmp_path / "run")


def test_a_store_without_the_features_is_told(raw, base, tmp_path):
    prepare("beat", raw, tmp_path / "plain", fps=15, filters=False)
    with pytest.raises(InputError, match="no 'wav2vec'"):
        train(recipe(base), tmp_path / "plain", tmp_path / "run")


def test_what_streams_cannot_hear_through_it(base):
    sizes = {"pose": 6, "audio": 5, "speakers": 2, "hands": [4, 5], "text": 0}
    ChainOfGeneration(ChainConfig(**TINY, speech_encoder="wav2vec", encoder=base), **sizes)
    with pytest.raises(InputError, match="hears all of a speech"):
        ChainLive(ChainLiveConfig(**TINY, speech_encoder="wav2vec", encoder=base), **sizes)
