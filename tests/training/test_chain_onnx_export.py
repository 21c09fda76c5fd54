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
from cospeech.runtime.chain_engine import ChainEngine  # noqa: E402
from cospeech.training.export.chain_graph import lower_chain  # noqa: E402

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


def asked(**changes: Any) -> ChainOfGenerationExtended:
    """That was trained to be given faces and seed poses, and to do without."""
    return chain(face_teacher_forcing=0.3, seed_dropout=0.7, **changes)


def many(kind: type, config: type, **changes: Any) -> Any:
    hands = {"hands": HANDS} if kind is Camn else {}
    return kind(config(**(_MANY | changes)), pose=POSE, audio=AUDIO, speakers=SPEAKERS, text=0, **hands)


CASES = {
    "chain": lambda: chain(),
    "chain with noise": lambda: chain(noise=4),
    "chain without seeds": lambda: chain(seeds=0, noise=2),
    "chain of vectors": lambda: chain(text=300),
    "chain of one layer": lambda: chain(layers=1, latent=8),
    "chain that is given": lambda: asked(noise=2),
    "chain that is given, without noise": lambda: asked(),
    "live": lambda: live(),
    "live of one that is given": lambda: live(noise=3, face_teacher_forcing=0.3, seed_dropout=0.7),
    "live with noise": lambda: live(noise=4),
    "live, far ahead": lambda: live(noise=1, look_ahead=9, pooling_window=3),
    "camn": lambda: many(Camn, CamnConfig),
    "camn, deep": lambda: many(Camn, CamnConfig, layers=3),
    "multi-context": lambda: many(MultiContext, MultiContextConfig),
    "multi-context of all": lambda: many(MultiContext, MultiContextConfig, emotion=8, speaker=3, layers=3),
    "multi-context without a face": lambda: many(MultiContext, MultiContextConfig, emotion=8, face=0),
}


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
def engine(name: str) -> ChainEngine:
    low = lower_chain(network(name))
    bound = np.full(low.sizes.pose, 1e3)
    return ChainEngine(low.sizes, low.weights, low.graphs, -bound, bound)


def material(who: ChainEngine, takes: int, frames: int) -> list[np.ndarray]:
    rng, s = np.random.default_rng(0), who.sizes
    rows, noise = rng.normal(size=(frames, s.rows)), rng.normal(size=(takes, frames, s.noise))
    return [x.astype(np.float32) for x in (rows, rng.uniform(size=(takes, frames, s.style)), noise)]


@torch.no_grad()
def run_exported(net: Any, rows: np.ndarray, style: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """(N, T, D) of PyTorch."""
    heard = torch.from_numpy(rows).expand(len(style), -1, -1)
    made: np.ndarray = net.make(heard, torch.from_numpy(style), torch.from_numpy(noise)).numpy()
    return made


@pytest.mark.parametrize("frames", [1, 2, 34, 75])
@pytest.mark.parametrize("name", CASES)
def test_windows(name, frames):
    net, who = network(name), engine(name)
    given = material(who, 3, frames)
    wanted = run_exported(getattr(net, "teacher", net), *given)
    made = who.windows.make(*given)
    assert wanted.std() > 0.01
    np.testing.assert_allclose(made, wanted, atol=TOLERANCE)
    alone = [who.windows.make(given[0], given[1][k : k + 1], given[2][k : k + 1]) for k in range(3)]
    assert np.concatenate(alone).tobytes() == made.tobytes()


@torch.no_grad()
@pytest.mark.parametrize("name", [name for name in CASES if "is given" in name])
def test_faces_and_seed_poses(name):
    """As PyTorch is given them, also of some frames alone; half given lies between."""
    net, who, frames = getattr(network(name), "teacher", network(name)), engine(name), 40
    assert (who.sizes.faces, who.sizes.seeds, who.windows.optional) == (52, 4, {"face": 53, "seed": POSE + 1})
    rows, style, noise = material(who, 2, frames)
    rng = np.random.default_rng(1)
    face, poses = rng.uniform(0, 9, (frames, 52)), rng.normal(size=(frames, POSE))
    face, poses = face.astype(np.float32), poses.astype(np.float32)
    known = (np.arange(frames) < 25)[:, None]
    begun = (np.arange(frames) < 4)[:, None]
    given = {"face": np.concatenate([face * known, known], 1), "seed": np.concatenate([poses * begun, begun], 1)}
    heard, how, drawn = (torch.from_numpy(np.broadcast_to(x, (2, *x.shape[-2:])).copy()) for x in (rows, style, noise))
    seeds = net.mask_seeds(torch.from_numpy(poses).mT[None].expand(2, -1, -1), torch.ones(1, 1, 1, dtype=torch.bool))
    seen = torch.from_numpy(np.where(known, face, np.nan).astype(np.float32)).mT[None].expand(2, -1, -1)
    plain = who.windows.make(rows, style, noise)
    for names in (("face",), ("seed",), ("face", "seed")):
        own = seeds if "seed" in names else torch.zeros_like(seeds)
        wanted = net.poses(heard.mT, how.mT, drawn.mT, own, seen if "face" in names else None).pose.mT.numpy()
        made = who.windows.make(rows, style, noise, more={key: given[key] for key in names})
        np.testing.assert_allclose(made, wanted, atol=TOLERANCE)
        assert np.abs(made - plain).max() > 1e-3
        alone = who.windows.make(rows, style[1:], noise[1:], more={key: given[key] for key in names})
        assert alone[0].tobytes() == made[1].tobytes()
    for more in ({"face": face}, {"mood": face}, {"seed": given["seed"][1:]}):
        with pytest.raises(InputError):
            who.windows.make(rows, style, noise, more=more)


def test_who_may_be_given_what():
    assert engine("chain").windows.optional == engine("live").windows.optional == {"seed": POSE + 1}  # as published
    for name in ("chain without seeds", "camn", "multi-context of all"):
        assert engine(name).windows.optional == {}


@pytest.mark.parametrize("name", [name for name in CASES if "live" in name])
def test_frame_by_frame(name):
    """The pose of a frame comes out when ``look_ahead`` further ones were heard, of which the last is held at the end."""
    net, who = network(name), engine(name)
    frames, delay = 60, who.sizes.look_ahead
    rows, style, noise = material(who, 3, frames)
    wanted, under_way, made = run_exported(net, rows, style, noise), who.live(3), []
    for k in range(frames + delay):
        k = min(k, frames - 1)
        made.append(under_way.frame(rows[k], style[:, k], noise[:, k]))
    assert wanted.std() > 0.01
    np.testing.assert_allclose(np.stack(made[delay:], 1), wanted, atol=TOLERANCE)
    alone = who.live(1)
    for k in range(20):
        assert alone.frame(rows[k], style[1:2, k], noise[1:2, k])[0].tobytes() == made[k][1].tobytes()


@pytest.mark.parametrize("name", [name for name in CASES if "chain" in name or "live" in name])
def test_who_speaks_and_how(name):
    net, who = network(name), engine(name)
    whole, reach = getattr(net, "teacher", net), who.sizes.reach
    rows = np.random.default_rng(0).normal(size=(30, AUDIO)).astype(np.float32)
    with torch.no_grad():
        wanted = whole.classify(torch.from_numpy(rows)[None])[0].numpy()
    np.testing.assert_allclose(who.classify(rows), wanted[reach:-reach], atol=TOLERANCE)


def test_what_each_has():
    assert {name for name in CASES if engine(name).adversarial} == {name for name in CASES if "chain" in name or "live" in name}
    assert {name for name in CASES if engine(name).lives} == {name for name in CASES if "live" in name}
    sizes = engine("live, far ahead").sizes
    assert (sizes.look_ahead, sizes.noise, sizes.words, sizes.speakers) == (9, 1, 5, SPEAKERS)
    assert engine("chain of vectors").sizes.words == 300
    assert engine("multi-context of all").sizes.noise == 3
