"""Runs that begin with the parameters of another run, or of a bundle of the stylised flow."""

from __future__ import annotations

import json

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch (cospeech[train])")

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.nn.conditioning import GlobalEncoder  # noqa: E402
from cospeech.models.stylised_flow_extended import FlowExtendedConfig, StylisedFlowExtended  # noqa: E402
from cospeech.runtime.bundles.bundle import read_bundle  # noqa: E402
from cospeech.runtime.bundles.spec import WEIGHTS, read_spec  # noqa: E402
from cospeech.runtime.flow.weights import pack_weights, unpack  # noqa: E402
from cospeech.training.checkpoint import load_run  # noqa: E402
from cospeech.training.flow_weights import calibrate_norms, unpack_flow  # noqa: E402
from cospeech.training.recipe import read_recipe  # noqa: E402
from cospeech.training.start import start_from  # noqa: E402
from cospeech.training.train import train  # noqa: E402
from tests.support.runtime_bundles import write_small  # noqa: E402
from tests.support.tiny_store import make_store  # noqa: E402

MODEL = {
    "steps": 2, "hidden": 8, "history": 4, "look_ahead": 2, "frames": 12, "encoder_channels": 6, "encoder_blocks": 1,
    "style": 3, "style_window": 10, "residual": True, "reconstruction": 0.0, "perceptual": 0.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return make_store(tmp_path_factory.mktemp("start") / "tiny")


def recipe(config=None, **train_settings):
    settings = {"batch": 8, "threads": 1, "validate_every": 0, "lr": 1e-6} | train_settings
    return read_recipe({"model": {"name": "stylised-flow-extended", **MODEL, **(config or {})}, "train": settings})


@pytest.fixture(scope="module")
def first(store, tmp_path_factory):
    folder = tmp_path_factory.mktemp("start") / "first"
    train(recipe(steps=30, lr=1e-2, seed=1), store, folder)
    return folder


def far_apart(one, other):
    return max(float((one[name] - other[name]).abs().max()) for name in one if one[name].is_floating_point())


def test_a_run_begins_with_the_parameters_of_another(store, first, tmp_path):
    notes = []
    train(recipe(steps=1, start=str(first), seed=2), store, tmp_path / "second", notice=notes.append)
    states = [load_run(folder)[0].state_dict() for folder in (first, tmp_path / "second")]
    weights = [{n: v for n, v in state.items() if "running" not in n} for state in states]
    assert far_apart(*weights) < 1e-4  # one step of a rate of 1e-6
    assert len(notes) == 1
    assert f"are those of {str(first)!r}" in notes[0]
    assert "new" not in notes[0]


def test_parts_that_the_other_run_has_not_begin_anew_and_are_named(store, first, tmp_path):
    notes = []
    more = recipe({"style_recognition": 1.0, "style_steps": 2}, steps=1, start=str(first))
    train(more, store, tmp_path / "second", notice=notes.append)
    assert notes[0].endswith("; new: recogniser, speaker_of_code")


def test_a_continued_run_does_not_begin_again(store, first, tmp_path):
    notes = []
    sections = recipe(steps=2, start=str(first), lr=1e-2)
    train(sections, store, tmp_path / "one", notice=notes.append)
    train(recipe(steps=4, start=str(first), lr=1e-2), store, tmp_path / "one", resume=True, notice=notes.append)
    train(recipe(steps=4, start=str(first), lr=1e-2), store, tmp_path / "other")
    states = [load_run(tmp_path / name)[0].state_dict() for name in ("one", "other")]
    assert far_apart(*states) == 0
    assert len(notes) == 1
    assert json.loads((tmp_path / "one" / "config.json").read_text("utf-8"))["recipe"]["train"]["start"] == str(first)


@pytest.mark.parametrize(
    ("start", "says"),
    [
        ("nowhere", "nowhere"),
        ("mix-stage", "no bundle of the stylised flow"),
        ("stylised-flow", "no parameter of .* fits"),
    ],
)
def test_a_start_that_does_not_fit_is_told(store, tmp_path, start, says):
    with pytest.raises(InputError, match=says):
        train(recipe({"encoder": False, "style": 0, "steps": 1, "hidden": 5}, steps=1, start=start), store, tmp_path / "run")
    assert not (tmp_path / "run" / "last.safetensors").exists()


def test_a_batch_of_one_is_too_small_for_style_codes(store, tmp_path):
    with pytest.raises(InputError, match=r"train\.batch is 1 .at least 2"):
        train(recipe(steps=1, batch=1), store, tmp_path / "run")
    assert train(recipe({"style": 0}, steps=1, batch=1), store, tmp_path / "other").step == 1


def flow_of(path):
    """A network of the sizes of a bundle, in evaluation mode, and the bundle."""
    spec = read_spec(bundle := read_bundle(path))
    sizes = spec.flow
    config = FlowExtendedConfig(
        steps=sizes.steps, hidden=sizes.hidden, layers=sizes.layers, history=sizes.history,
        look_ahead=sizes.speech_frames - sizes.history - 1, frames=12, encoder_channels=sizes.channels,
        encoder_blocks=sizes.blocks, feature=sizes.feature, style=sizes.style, style_window=10, encoder_relu=sizes.encoder_relu,
    )  # fmt: skip
    torch.manual_seed(3)
    return StylisedFlowExtended(config, pose=sizes.pose, audio=sizes.audio).eval(), bundle, sizes


def test_a_network_begins_with_the_weights_of_a_bundle(tmp_path):
    write_small(tmp_path / "it.cospeech")
    net, bundle, sizes = flow_of(tmp_path / "it.cospeech")
    rng = torch.Generator().manual_seed(0)
    batch = {
        "pose": torch.randn(6, net.window, sizes.pose, generator=rng),
        "audio": torch.randn(6, net.window, sizes.audio, generator=rng),
    }
    assert "new" not in start_from(net, str(tmp_path / "it.cospeech"), batch)
    weights, again = bundle.arrays(WEIGHTS), pack_weights(net.export(), sizes)
    for name in {name.removesuffix(".q").removesuffix(".s") for name in weights}:
        one, other = unpack(weights, name), unpack(again, name)
        np.testing.assert_allclose(other, one, atol=2e-3 * np.abs(one).max(), rtol=1e-3, err_msg=name)
    with torch.no_grad():  # in training, batch norms see this batch: the encoder gives what it gives in evaluation
        _, histories, speech = net._windows(batch["pose"], batch["audio"])
        expected = net.encoder(histories, speech)
        torch.testing.assert_close(net.encoder.train()(histories, speech), expected, atol=1e-4, rtol=1e-4)


def test_norms_take_the_statistics_of_a_run_and_change_nothing():
    torch.manual_seed(0)
    encoder = GlobalEncoder(5, 3, channels=6, blocks=2, feature=4, oldest=False, relu=True).eval()
    for name, value in encoder.state_dict().items():
        if "norm" in name and value.is_floating_point():
            value.copy_(0.5 + torch.rand(value.shape))
    inputs = 2 + torch.randn(7, 9, 6, 5), torch.randn(7, 9, 8, 3)
    with torch.no_grad():
        before = encoder(*inputs)
        calibrate_norms(encoder, lambda: encoder(*inputs))
        torch.testing.assert_close(encoder(*inputs), before, atol=1e-5, rtol=1e-4)
        torch.testing.assert_close(encoder.train()(*inputs), before, atol=1e-4, rtol=1e-3)


def test_what_was_unpacked_is_packed_again(tmp_path):
    write_small(tmp_path / "it.cospeech")
    _, bundle, sizes = flow_of(tmp_path / "it.cospeech")
    arrays = unpack_flow(bundle.arrays(WEIGHTS), sizes)
    assert all(torch.isfinite(value).all() for value in arrays.values())
    assert {name.partition(".")[0] for name in arrays} == {"encoder", "flow", "stylist"}
