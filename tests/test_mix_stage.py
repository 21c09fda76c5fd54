"""Mix-StAGE: priors, which parameters each loss reaches in the paper's and in the authors' reading, sizes, generation."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from safetensors.torch import load_file  # noqa: E402
from torch import Tensor  # noqa: E402

from cospeech.checkpoint import load_run  # noqa: E402
from cospeech.corpora.store_files import Entry  # noqa: E402
from cospeech.corpora.store_writer import Piece, write_store  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.models.mix_stage import MixStage, MixStageConfig  # noqa: E402
from cospeech.nn.mixture import ModeLogits  # noqa: E402
from cospeech.nn.objective import Batch, Chance  # noqa: E402
from cospeech.poses.keypoints2d import KEYPOINTS2D  # noqa: E402
from cospeech.recipe import read_recipe  # noqa: E402
from cospeech.train import train  # noqa: E402

torch.set_num_threads(1)
POSE, AUDIO, SPEAKERS, MODES, ROWS = 6, 16, 3, 4, 3
TINY = {"modes": MODES, "channels": 8, "depth": 3, "style": 4, "patch_channels": 4}
AUTHORS = {"soft": True, "l1_adversarial": True, "growth": 0.1, "id_freezes": True}
PARTS = ("audio_content", "pose_content", "style.encoder", "style.matrix", "unet", "generators", "mode_logits", "discriminator")


def network(seed: int = 0, **changes) -> MixStage:
    torch.manual_seed(seed)
    return MixStage(MixStageConfig(**(TINY | changes)), pose=POSE, audio=AUDIO, speakers=SPEAKERS)


def batch(seed: int = 0, rows: int = ROWS, step: int = 0, modes: int = MODES) -> Batch:
    draw = torch.Generator().manual_seed(seed)
    arrays = {
        "pose": torch.randn(rows, 64, POSE, generator=draw).cumsum(1) / 8,
        "audio": torch.randn(rows, 64, AUDIO, generator=draw).cumsum(1) / 8,
        "cluster": torch.randint(modes, (rows, 64), generator=draw),
        "speaker": torch.arange(rows) % SPEAKERS,
    }
    return Batch(arrays, Chance(seed, step))


def part_of(name: str) -> str:
    """`unet.first.0.weight` → `unet`."""
    return ".".join(name.split(".")[: 2 if name.startswith("style.") else 1])


def reached(net: MixStage, term: Tensor) -> set[str]:
    """Parts of which some parameter has a gradient."""
    named = dict(net.named_parameters())
    gradients = torch.autograd.grad(term, list(named.values()), allow_unused=True, retain_graph=True)
    return {part_of(name) for name, g in zip(named, gradients, strict=True) if g is not None and g.abs().max() > 0}


@pytest.mark.parametrize("modes", [1, 2, MODES])
def test_priors_sum_to_one(modes):
    net = network(modes=modes).eval()
    with torch.no_grad():
        z = net.latent(net.audio_content(batch()["audio"]), torch.eye(SPEAKERS).unsqueeze(1))
        priors = torch.softmax(net._logits(z), 1)
    assert priors.shape == (ROWS, modes, 64)
    assert (priors >= 0).all()
    assert torch.allclose(priors.sum(1), torch.ones(ROWS, 64), atol=1e-6)


@pytest.mark.parametrize("owner", range(MODES))
def test_one_hot_training_updates_only_the_owner(owner):
    net, data = network().train(), batch()
    data = Batch({**data.arrays, "cluster": torch.full((ROWS, 64), owner)}, data.chance)
    terms = net.generator_loss(data, 0)
    values = list(net.generators.parameters())
    for term in (terms["rec"], terms["joint"], terms["id"], terms["adv"]):
        for gradient in torch.autograd.grad(term, values, retain_graph=True):
            own = gradient.view(MODES, -1).abs().amax(1)
            assert all(own[m] == 0 for m in range(MODES) if m != owner)
        last = torch.autograd.grad(term, net.generators.out.weight, retain_graph=True)[0]
        assert last.view(MODES, -1).abs().amax(1)[owner] > 0


def test_soft_training_updates_all():
    net, data = network(soft=True).train(), batch()
    gradient = torch.autograd.grad(net.generator_loss(data, 0)["rec"], net.generators.out.weight)[0]
    assert (gradient.view(MODES, -1).abs().amax(1) > 0).all()


PAPER = {
    "mix": {"audio_content", "pose_content", "unet", "style.matrix", "mode_logits"},
    "joint": {"pose_content", "unet", "style.matrix", "generators"},
    "rec": {"audio_content", "unet", "style.matrix", "generators"},
    "id": {"style.encoder", "audio_content", "unet", "style.matrix", "generators"},
    "adv": {"audio_content", "unet", "style.matrix", "generators", "discriminator"},  # D has a gradient, but is not in the objective
}


def test_what_each_loss_reaches_in_the_paper():
    net = network().train()
    terms = net.generator_loss(batch(), 0)
    assert {name: reached(net, term) for name, term in terms.items()} == PAPER
    for term in net.discriminator_loss(batch(), 0).values():
        assert reached(net, term) == {"discriminator"}
    assert set().union(*PAPER.values()) == set(PARTS)


def test_what_each_loss_reaches_in_the_authors_code():
    net = network(**AUTHORS).train()
    terms = net.generator_loss(batch(), 0)
    assert {name: reached(net, term) for name, term in terms.items()} == {
        name: parts | ({"mode_logits"} if name != "mix" else set()) for name, parts in PAPER.items()
    }
    for term in net.discriminator_loss(batch(), 0).values():
        assert reached(net, term) == {"discriminator"}


@pytest.mark.parametrize("freezes", [False, True])
def test_the_style_encoder_judges_generated_poses_frozen_or_not(freezes):
    net = network(id_freezes=freezes).train()
    made = torch.randn(ROWS, POSE, 64, requires_grad=True)
    loss = net.style.judge(made).square().sum()
    assert torch.autograd.grad(loss, made, retain_graph=True)[0].abs().max() > 0
    assert ("style.encoder" in reached(net, loss)) is not freezes


def test_objectives_share_out_all_parameters():
    net = network()
    judge, others = ({id(p) for p in objective.parameters} for objective in net.objectives().values())
    assert judge == {id(p) for p in net.discriminator.parameters()}
    assert not judge & others
    assert judge | others == {id(p) for p in net.parameters()}
    assert list(net.objectives()) == ["discriminator", "generator"]
    due = [[o.due(step) for o in network(alternate=True).objectives().values()] for step in range(4)]
    assert due == [[True, False], [False, True]] * 2


def test_a_curriculum_goes_from_pose_to_speech():
    net = network(curriculum=10).train()
    reach = {}
    for step in (0, 5, 10):
        terms = net.generator_loss(batch(step=step, rows=8), step)
        assert set(terms) == {"rec", "mix", "id", "adv"}
        reach[step] = reached(net, terms["rec"]) & {"audio_content", "pose_content"}
    assert reach == {0: {"pose_content"}, 5: {"audio_content", "pose_content"}, 10: {"audio_content"}}


def test_the_adversarial_terms_are_those_of_equation_7_or_of_the_authors():
    data = batch()
    judged = network().eval().discriminator_loss(data, 0)
    fooled = network().eval().generator_loss(data, 0)["adv"]
    assert torch.allclose(judged["false"], -fooled)  # what D maximises, the others minimise
    net = network(l1_adversarial=True, growth=0.1).eval()
    first, later, last = (net.discriminator_loss(data, step)["false"] for step in (0, 301, 10**6))
    assert torch.allclose(later, 1.1 * first)
    assert torch.allclose(last, 2 * first)


def test_styles_of_generation_are_mixed_and_may_change():
    net = network().train()
    with torch.no_grad():
        for _ in range(3):
            net.generator_loss(batch(), 0)
    net.eval()
    audio, eye = batch(rows=1)["audio"][:, :50], torch.eye(SPEAKERS)
    one, other, half = (net.generate(audio, w.view(1, 1, -1)) for w in (eye[0], eye[1], (eye[0] + eye[1]) / 2))
    assert one.shape == (1, 50, POSE)
    assert (one - other).abs().mean() > 1e-3
    assert (half - one).abs().mean() < (other - one).abs().mean()
    switched = net.generate(audio, torch.stack([eye[0]] * 25 + [eye[1]] * 25).unsqueeze(0))
    assert torch.equal(switched[:, :19], one[:, :19])  # H's six kernels reach 6 frames ahead
    assert not torch.allclose(switched[:, 30:], one[:, 30:], atol=1e-4)
    with pytest.raises(InputError, match="styles of shape"):
        net.generate(audio, eye[:2].view(1, 2, -1))
    with pytest.raises(InputError, match="speech of shape"):
        net.generate(audio[:, :0], eye[:1].view(1, 1, -1))


def test_style_of_a_clip_is_probabilities():
    found = network().eval().style_of(batch()["pose"])
    assert torch.allclose(found.sum(1), torch.ones(ROWS), atol=1e-6)


def test_styles_are_learnt():
    """After some steps the style encoder knows three speakers who hold themselves apart, and speech is put into each style."""
    net, data = network(channels=16).train(), batch(rows=6)
    pose = 0.3 * data["pose"] + (data["speaker"] - 1.0).view(-1, 1, 1)
    data = Batch({**data.arrays, "pose": pose}, data.chance)
    objectives = [(o, torch.optim.Adam(list(o.parameters), 3e-3)) for o in net.objectives().values()]
    for step in range(60):
        for objective, adam in objectives:
            adam.zero_grad()
            sum(objective.loss(data, step).values()).backward()
            adam.step()
    net.eval()
    assert torch.equal(net.style_of(pose).argmax(1), data["speaker"])
    levels = [net.generate(data["audio"], torch.eye(SPEAKERS)[k].expand(6, 1, -1)).mean().item() for k in range(SPEAKERS)]
    assert levels[0] < -0.4 < levels[1] < 0.4 < levels[2]


@pytest.mark.parametrize("wrong", [{"frames": 0}, {"frames": 68}, {"modes": 0}, {"depth": 2}, {"frames": 32}])
def test_sizes_that_are_none_are_told(wrong):
    with pytest.raises(InputError):
        network(**wrong)


def test_with_one_sub_generator_it_is_stage():
    net = network(modes=1).eval()  # in training a bias before a batch norm has no gradient
    terms = net.generator_loss(batch(modes=1), 0)
    assert set(terms) == {"rec", "joint", "id", "adv"}
    sum(terms.values()).backward()
    others = list(net.objectives()["generator"].parameters)
    assert all(p.grad is not None and p.grad.abs().max() > 0 for p in others)


def test_sizes_at_paper_width():
    """The authors' layers, rebuilt: 15.32 M used with M = 8, 9.56 M with M = 1 and an H of one class; D .191 M."""
    count = {}
    with torch.device("meta"):
        for modes in (8, 1):
            net = MixStage(MixStageConfig(modes=modes), pose=96, audio=64, speakers=8)
            judge = sum(p.numel() for p in net.discriminator.parameters())
            assert judge == pytest.approx(191e3, rel=0.02)
            count[modes] = sum(p.numel() for p in net.parameters()) - judge
        idle = sum(p.numel() for p in ModeLogits(256 + 10, 256, 1).parameters())
    assert count[8] == pytest.approx(15.32e6, rel=0.02)
    assert count[1] + idle == pytest.approx(9.56e6, rel=0.02)


def test_it_trains_from_a_store_of_key_points(tmp_path):
    """Through the loop: clusters worked out of the poses, speakers balanced, the centres kept with the run."""
    names = {"pose": KEYPOINTS2D.names, "audio": tuple("vwxyz")}
    draw = np.random.default_rng(0)
    pieces = []
    for k, (name, split) in enumerate([("ann", "train"), ("bob", "train"), ("ann", "validation")]):
        values = {
            "pose": (300.0 * k + draw.normal(0, 5, (90, 96)).cumsum(0)).astype(np.float32),
            "audio": draw.normal(0, 1, (90, 5)).astype(np.float32),
        }
        entry = Entry(f"{name}-{k}", name, split, 0, 90, 0.0, tuple(values))
        pieces.append(Piece(entry, (), lambda values=values: dict(values)))
    write_store(tmp_path / "store", pieces, corpus="pats", pose="keypoints2d", fps=15.0, names=names)
    settings = {"steps": 3, "batch": 4, "validate_every": 3, "validate_batches": 1, "balance": True, "best": "generator.rec"}
    plan = {"model": {"name": "mix-stage", **TINY, "modes": 2}, "train": settings | {"threads": 1}}
    report = train(read_recipe(plan), tmp_path / "store", tmp_path / "run")
    assert report.step == 3
    assert report.best["name"] == "generator.rec"
    statistics = load_file(tmp_path / "run" / "statistics.safetensors")
    assert statistics["cluster_centres"].shape == (2, 240)
    model, facts = load_run(tmp_path / "run")
    assert facts["sizes"]["speakers"] == model.styles == 2
