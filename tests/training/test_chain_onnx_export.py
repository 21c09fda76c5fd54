"""Networks of many inputs as graphs: what onnxruntime makes is what PyTorch makes, of every network of the family."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")
pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from torch import nn  # noqa: E402

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.camn import Camn, CamnConfig  # noqa: E402
from cospeech.models.chain_live import ChainLive  # noqa: E402
from cospeech.models.chain_of_generation_extended import ChainOfGenerationExtended  # noqa: E402
from cospeech.models.multi_context import MultiContext, MultiContextConfig  # noqa: E402
from cospeech.runtime.network import Network  # noqa: E402
from cospeech.training.export.onnx_export import Exported  # noqa: E402
from tests.support.exports import export_graphs  # noqa: E402

POSE, AUDIO, SPEAKERS, HANDS = 11, 7, 3, (2, 3, 8)
_CHAIN = {"frames": 34, "latent": 16, "hidden": 12, "layers": 2, "word_width": 5, "text_channels": 9, "classifier_channels": 6}
_MANY = {"hidden": 16, "layers": 2, "audio": 8, "text": 8, "face": 6, "word_width": 5}
TOLERANCE = 2e-5  # of poses of about 1: float32


def chain(**changes: Any) -> ChainOfGenerationExtended:
    sizes = {"pose": POSE, "audio": AUDIO, "speakers": SPEAKERS, "hands": HANDS, "text": changes.pop("text", 0)}
    return ChainOfGenerationExtended(ChainOfGenerationExtended.Config(**(_CHAIN | changes)), **sizes)


def live(**changes: Any) -> ChainLive:
    own = {name: changes.pop(name) for name in ("look_ahead", "pooling_window") if name in changes}
    teacher = chain(**changes)
    config = ChainLive.Config(**(_CHAIN | {"look_ahead": 5} | own | changes))
    return ChainLive(config, teacher=teacher, pose=POSE, audio=AUDIO, speakers=SPEAKERS, hands=HANDS, text=0)


def chain_with_inputs(**changes: Any) -> ChainOfGenerationExtended:
    """A network that was trained with and without faces and seed poses."""
    return chain(face_teacher_forcing=0.3, seed_dropout=0.7, **changes)


def many(kind: type, config: type, **changes: Any) -> Any:
    hands = {"hands": HANDS} if kind is Camn else {}
    return kind(config(**(_MANY | changes)), pose=POSE, audio=AUDIO, speakers=SPEAKERS, text=0, **hands)


CASES = {
    "chain": lambda: chain(),
    "chain of vectors, without seeds": lambda: chain(text=300, seeds=0, noise=2),
    "chain that is given": lambda: chain_with_inputs(layers=1, latent=8),
    "live with noise": lambda: live(noise=4),
    "live of one that is given, far ahead": lambda: live(
        noise=1, look_ahead=9, pooling_window=3, face_teacher_forcing=0.3, seed_dropout=0.7
    ),
    "camn": lambda: many(Camn, CamnConfig, layers=3),
    "multi-context of all": lambda: many(MultiContext, MultiContextConfig, emotion=8, speaker=3),
    "multi-context without a face": lambda: many(MultiContext, MultiContextConfig, emotion=8, face=0, layers=1),
}
"""A graph costs seconds of PyTorch's time, so a case changes several things at once."""
QUICK = ("live with noise", "camn", "multi-context of all")
"""One of each architecture; of the live one ``make`` is its teacher's, a chain."""


def select(part: str = "") -> list[Any]:
    """Names of cases with ``part`` in them, all but one of each architecture slow."""
    return [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in CASES if part in name]


@cache
def network(name: str) -> Any:
    """In evaluation mode, batch norms that do something."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        net = CASES[name]()
        for part in net.modules():
            if getattr(part, "running_mean", None) is not None:
                part.running_mean.normal_(0, 0.3)
                part.running_var.uniform_(0.5, 2)
                nn.init.uniform_(part.weight, 0.5, 1.5)
    return net.eval()


@cache
def export_network(name: str) -> Exported:
    """An export takes seconds."""
    return export_graphs(network(name).export_module())


@cache
def networks(name: str) -> dict[str, Network]:
    low = export_network(name)
    return {key: Network(signature, low.graphs[key], low.weights) for key, signature in low.signatures.items()}


def widths(who: Network) -> tuple[int, ...]:
    return tuple(map(who.signature.width, ("rows", "style", "noise")))


def material(who: Network, takes: int, frames: int) -> list[np.ndarray]:
    rng, (rows, style, noise) = np.random.default_rng(0), widths(who)
    arrays = rng.normal(size=(frames, rows)), rng.uniform(size=(takes, frames, style)), rng.normal(size=(takes, frames, noise))
    return [x.astype(np.float32) for x in arrays]


def ports(rows, style, noise) -> dict[str, np.ndarray]:
    """The inputs by name; those of no width are left out."""
    return {"rows": rows[None], "style": style} | ({"noise": noise} if noise.shape[-1] else {})


@torch.no_grad()
def run_torch(net: Any, rows: np.ndarray, style: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """(N, T, D) poses that PyTorch gives."""
    speech = torch.from_numpy(rows).expand(len(style), -1, -1)
    poses: np.ndarray = net.make(speech, torch.from_numpy(style), torch.from_numpy(noise)).numpy()
    return poses


@pytest.mark.parametrize("frames", [1, 2, 34, 75])
@pytest.mark.parametrize("name", select())
def test_windows(name, frames):
    net, who = network(name), networks(name)["make"]
    given = material(who, 3, frames)
    expected = run_torch(getattr(net, "teacher", net), *given)
    poses = who.run(**ports(*given))["poses"]
    assert expected.std() > 0.01
    np.testing.assert_allclose(poses, expected, atol=TOLERANCE)
    alone = [who.run(**ports(given[0], given[1][k : k + 1], given[2][k : k + 1]))["poses"] for k in range(3)]
    assert np.concatenate(alone).tobytes() == poses.tobytes()


@torch.no_grad()
@pytest.mark.parametrize("name", select("is given"))
def test_faces_and_seed_poses(name):
    """As PyTorch is given them, also of some frames alone; half given lies between."""
    net, who, frames = getattr(network(name), "teacher", network(name)), networks(name)["make"], 40
    assert (who.signature.width("face"), who.signature.width("seed"), who.signature.seeds) == (53, POSE + 1, 4)
    rows, style, noise = material(who, 2, frames)
    rng = np.random.default_rng(1)
    face, poses = rng.uniform(0, 9, (frames, 52)), rng.normal(size=(frames, POSE))
    face, poses = face.astype(np.float32), poses.astype(np.float32)
    has_face = (np.arange(frames) < 25)[:, None]
    has_seed = (np.arange(frames) < 4)[:, None]
    given = {"face": np.concatenate([face * has_face, has_face], 1), "seed": np.concatenate([poses * has_seed, has_seed], 1)}
    speech, how, modes = (torch.from_numpy(np.broadcast_to(x, (2, *x.shape[-2:])).copy()) for x in (rows, style, noise))
    seeds = net.mask_seeds(torch.from_numpy(poses).mT[None].expand(2, -1, -1), torch.ones(1, 1, 1, dtype=torch.bool))
    face_or_nan = torch.from_numpy(np.where(has_face, face, np.nan).astype(np.float32)).mT[None].expand(2, -1, -1)
    plain = who.run(**ports(rows, style, noise))["poses"]
    for names in (("face",), ("seed",), ("face", "seed")):
        own = seeds if "seed" in names else torch.zeros_like(seeds)
        expected = net.poses(speech.mT, how.mT, modes.mT, own, face_or_nan if "face" in names else None).pose.mT.numpy()
        more = {key: given[key][None] for key in names}
        result = who.run(**ports(rows, style, noise), **more)["poses"]
        np.testing.assert_allclose(result, expected, atol=TOLERANCE)
        assert np.abs(result - plain).max() > 1e-3
        alone = who.run(**ports(rows, style[1:], noise[1:]), **more)["poses"]
        assert alone[0].tobytes() == result[1].tobytes()
    for more in ({"face": face}, {"mood": face}, {"seed": given["seed"][1:]}):
        with pytest.raises(InputError):
            who.run(**ports(rows, style, noise), **{key: x[None] for key, x in more.items()})


@pytest.mark.slow
def test_who_may_be_given_what():
    plain = {"rows", "style", "noise"}
    for name in ("chain", "live with noise"):
        assert {*networks(name)["make"].signature.inputs} - plain == {"seed"}  # as published
    for name in ("chain of vectors, without seeds", "camn", "multi-context of all"):
        assert not {*networks(name)["make"].signature.inputs} - plain


@pytest.mark.parametrize("name", select("live"))
def test_frame_by_frame(name):
    """The pose of a frame comes out when ``look_ahead`` further ones were heard, of which the last is held at the end."""
    net, who = network(name), networks(name)["live"]
    frames, delay = 60, who.signature.look_ahead
    rows, style, noise = material(who, 3, frames)
    expected, poses, state = run_torch(net, rows, style, noise), [], who.begin(3)
    alone, own = [], who.begin(1)
    for k in range(frames + delay):
        k = min(k, frames - 1)
        output = who.run(**ports(rows[k], style[:, k], noise[:, k]), **state)
        state = {key: output[f"next.{key}"] for key in state}
        poses.append(output["poses"])
        output = who.run(**ports(rows[k], style[1:2, k], noise[1:2, k]), **own)
        own = {key: output[f"next.{key}"] for key in own}
        alone.append(output["poses"][0])
    assert expected.std() > 0.01
    np.testing.assert_allclose(np.stack(poses[delay:], 1), expected, atol=TOLERANCE)
    assert np.stack(alone).tobytes() == np.stack(poses)[:, 1].tobytes()


@pytest.mark.parametrize("name", [*select("chain"), *select("live")])
def test_who_speaks_and_how(name):
    net, who = network(name), networks(name)["classify"]
    whole, reach = getattr(net, "teacher", net), who.signature.reach
    rows = np.random.default_rng(0).normal(size=(1, 30, AUDIO)).astype(np.float32)
    with torch.no_grad():
        expected = whole.classify(torch.from_numpy(rows))[0].numpy()
    np.testing.assert_allclose(who.run(rows=rows)["logits"][0, reach:-reach], expected[reach:-reach], atol=TOLERANCE)


@pytest.mark.slow
def test_what_each_has():
    assert {name for name in CASES if "classify" in networks(name)} == {n for n in CASES if "chain" in n or "live" in n}
    assert {name for name in CASES if "live" in networks(name)} == {name for name in CASES if "live" in name}
    live = networks("live of one that is given, far ahead")["live"]
    assert (live.signature.look_ahead, widths(live)) == (9, (AUDIO + 5, SPEAKERS + 8, 1))
    assert widths(networks("chain of vectors, without seeds")["make"])[0] == AUDIO + 300
    assert widths(networks("multi-context of all")["make"])[2] == 3
