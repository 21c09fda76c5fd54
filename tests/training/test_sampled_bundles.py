"""Bundles of systems whose motion is drawn: what they play, in pieces and at once, by which styles; what is no such bundle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch (the train extra)")
onnx = pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.audio.emotions import EMOTIONS  # noqa: E402
from cospeech.audio.speech import Speech, example  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.motion.motion import Motion  # noqa: E402
from cospeech.runtime.bundles.bundle import read_bundle  # noqa: E402
from cospeech.runtime.bundles.graph_check import OPERATORS  # noqa: E402
from cospeech.runtime.bundles.spec import half, read_spec, unpack_half  # noqa: E402
from cospeech.runtime.model import TrainedModel  # noqa: E402
from cospeech.runtime.network import Network  # noqa: E402
from cospeech.runtime.samplers import open_sampler  # noqa: E402
from cospeech.runtime.system import open_bundle  # noqa: E402
from cospeech.training.checkpoint import load_run  # noqa: E402
from cospeech.training.export.bundles import _rounding  # noqa: E402
from tests.support.runtime_bundles import cut, same  # noqa: E402
from tests.training.conftest import SAMPLERS  # noqa: E402

pytestmark = pytest.mark.slow
torch.set_num_threads(1)
BODY = {"parts": ("body", "hands")}


@pytest.fixture(scope="module")
def speech() -> Speech:
    return Speech.load(example()[0]).window(0, 3)


@pytest.mark.parametrize("name", SAMPLERS)
def test_what_comes_in_pieces_is_what_comes_at_once_and_takes_differ(sampler_bundle, speech, name):
    player = TrainedModel.open(sampler_bundle(name).path)
    one, other = player.generate_takes(speech, takes=2, seed=2, **BODY)
    assert len(one) == speech.frames(30.0)
    assert np.isfinite(one.rotations).all()
    assert not same(one, other)
    assert same(player.generate(speech, seed=2, **BODY), one)
    assert same(player.generate(speech, seed=3, **BODY), other)
    for edges in ([], [1, 7, 9000, 20_000]):
        assert same(Motion.concatenate(list(player.stream(cut(speech, edges), seed=2, **BODY))), one)
    still = player.generate_takes(speech, takes=2, seed=2, temperature=0.0, **BODY)
    assert same(*still)
    assert not same(still[0], one)


@pytest.mark.parametrize("name", SAMPLERS)
def test_graphs_and_sampler_draw_what_the_network_draws(sampler_bundle, name):
    """The noise is the same, and some steps are known; PyTorch's own loop is compared with the runtime's."""
    bundle = sampler_bundle(name)
    net, networks = load_run(bundle.run)[0].eval(), open_bundle(bundle.path).networks
    rng, steps, takes = np.random.default_rng(0), 5, 3
    rows = rng.normal(size=(1, 4 * steps, net.audio)).astype(np.float32)
    style = rng.random((takes, 1, net.styles)).astype(np.float32).repeat(steps, 1)
    sampler = open_sampler(networks)
    condition = networks["hear"].run(rows=rows)["heard"]
    noise = sampler.draw_noise(range(takes), np.arange(steps))
    assert noise.shape == (takes, steps, net.modes)
    assert np.array_equal(sampler.draw_noise([2], np.arange(3, 5)), noise[2:, 3:])
    speech, who, draws = (torch.from_numpy(x) for x in (rows, style, noise))
    speech = speech.expand(takes, -1, -1)
    with torch.no_grad():
        expected = net.make(speech, who.repeat_interleave(4, 1), draws.repeat_interleave(4, 1)).numpy()
        whole = sampler.draw(condition, style, noise, None, 1.0)
        np.testing.assert_allclose(networks["make"].run(latent=whole)["poses"], expected, atol=1e-3)
        first = whole[:, :2][::-1].copy()
        latents = sampler.draw(condition, style, noise, first, 1.0)
        codes = torch.from_numpy(first)
        if name == "talkshow":
            codes = codes.unflatten(2, (2, -1)).argmax(-1)
            again = net.draw(net.hear(speech.mT), who.mT, draws, codes)
            again = torch.nn.functional.one_hot(again, net.config.codes).flatten(2)
            assert (latents.sum(2) == 2).all()
        else:
            again = net.draw(net.hear(speech.mT), who[:, 0], draws, codes)
    np.testing.assert_allclose(latents, again.numpy(), atol=1e-3)
    np.testing.assert_allclose(latents[:, :2], first, atol=1e-6)


def test_styles_are_labels_and_examples(sampler_bundle, speech):
    player = TrainedModel.open(sampler_bundle("gesturediffuclip").path)
    system = player.system
    assert system.styles == ("big", "small", *EMOTIONS)
    assert system.style_space == "code"
    motions = {name: player.generate(speech, style=name, seed=1, **BODY) for name in ("big", "small", "anger")}
    assert not same(motions["big"], motions["small"])
    assert not same(motions["big"], motions["anger"])
    long = player.generate(Speech.load(example()[0]).window(0, 6), style="small", seed=1, **BODY)  # an example is 64 frames
    by_example = player.generate(speech, style=long, seed=1, **BODY)
    assert np.isfinite(by_example.rotations).all()
    assert not same(by_example, motions["big"])
    mixture = player.generate(speech, style="anger:0.5,small:0.5", seed=1, **BODY)
    assert not same(mixture, motions["small"])


def test_a_talkshow_plays_its_speakers_and_no_examples(sampler_bundle, speech):
    player = TrainedModel.open(sampler_bundle("talkshow").path)
    assert player.system.styles == ("big", "small")
    assert player.system.style_space == "one-hot"
    with pytest.raises(InputError, match="example"):
        player.generate(speech, style=player.generate(speech, **BODY), **BODY)


@pytest.mark.parametrize("name", SAMPLERS)
def test_rounded_weights_move_the_poses_by_what_is_told(sampler_bundle, name):
    spec = read_spec(read_bundle(sampler_bundle(name).path))
    exact, in_half_precision = (
        {key: Network(signature, spec.graphs[key], weights) for key, signature in spec.signatures.items() if key != "style"}
        for weights in (spec.weights, unpack_half(half(spec.weights)))
    )
    width = spec.signatures["hear"].width("rows")
    rows = np.random.default_rng(0).normal(size=(2, 40, width)).astype(np.float32)
    styles = spec.statistics.style_codes
    assert _rounding(exact, exact, rows, styles) == 0
    assert 0 < _rounding(exact, in_half_precision, rows, styles) < 0.01


@pytest.mark.parametrize("name", SAMPLERS)
def test_networks_that_do_not_fit_are_refused(sampler_bundle, name):
    bundle = read_bundle(sampler_bundle(name).path)
    sampler = "prior" if name == "talkshow" else "denoise"
    networks = bundle.manifest["networks"]
    wide = {key: [*shape[:-1], shape[-1] + 2] for key, shape in networks["hear"]["outputs"].items()}
    damages = [
        {key: value for key, value in networks.items() if key != "hear"},
        {key: value for key, value in networks.items() if key != sampler},
        networks | {"hear": networks["hear"] | {"outputs": wide}},
        networks | {sampler: networks[sampler] | ({"groups": 5} if name == "talkshow" else {"steps": 0})},
        networks | {"make": networks["make"] | {"hop": 6}},
    ]
    for wrong in damages:
        with pytest.raises(InputError, match=r"draw|prior|denoise|hear"):
            read_spec(replace(bundle, manifest={**bundle.manifest, "networks": wrong}))


def test_the_operators_that_only_these_need_are_in_their_graphs(sampler_bundle):
    graphs = [graph for name in SAMPLERS for graph in read_spec(read_bundle(sampler_bundle(name).path)).graphs.values()]
    operators = {node.op_type for graph in graphs for node in onnx.load_from_string(graph).graph.node}
    assert {"ConvTranspose", "MatMul"} <= operators <= OPERATORS
