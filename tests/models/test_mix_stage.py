"""Mix-StAGE: priors, which parameters each loss reaches in the paper's and in the authors' reading, sizes, generation."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from safetensors.torch import load_file  # noqa: E402
from torch import Tensor  # noqa: E402

from cospeech.corpora.store_files import Entry  # noqa: E402
from cospeech.corpora.store_writer import Piece, write_store  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.models.cmix_gan import CMixGan  # noqa: E402
from cospeech.models.mix_stage import MixGan, MixGanConfig, MixStage, MixStageConfig  # noqa: E402
from cospeech.models.mix_stage_extended import MixStageExtended, MixStageExtendedConfig  # noqa: E402
from cospeech.models.nn.mixture import ModeLogits  # noqa: E402
from cospeech.models.nn.motion_statistics_loss import motion_statistics  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.models.stage import Stage, StageConfig  # noqa: E402
from cospeech.motion.poses.keypoints2d import KEYPOINTS2D  # noqa: E402
from cospeech.training.checkpoint import load_run  # noqa: E402
from cospeech.training.recipe import read_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402

torch.set_num_threads(1)
POSE, AUDIO, SPEAKERS, MODES, ROWS = 6, 16, 3, 4, 3
TINY = {"modes": MODES, "channels": 8, "depth": 3, "style": 4, "patch_channels": 4}
AUTHORS = {"soft": True, "adversarial_loss": "distance", "growth": 0.1, "id_freezes": True}
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
    return Batch(arrays, StepRandom(seed, step))


def part_of(name: str) -> str:
    """`unet.first.0.weight` → `unet`."""
    return ".".join(name.split(".")[: 2 if name.startswith("style.") else 1])


def parts_with_gradient(net: MixGan, term: Tensor, whole: bool = False) -> set[str]:
    """Parts of which some parameter has a gradient that is not exactly zero; or, ``whole``, every one."""
    parameters = dict(net.named_parameters())
    gradients = torch.autograd.grad(term, list(parameters.values()), allow_unused=True, retain_graph=True)
    has_gradient = {name: g is not None and bool(g.abs().max() > 0) for name, g in zip(parameters, gradients, strict=True)}
    judge = all if whole else any
    parts = {part_of(name) for name in parameters}
    return {part for part in parts if judge(m for name, m in has_gradient.items() if part_of(name) == part)}


def freeze_statistics(net: MixGan) -> MixGan:
    """In training mode with running statistics: else a bias before a batch norm has a gradient of noise."""
    net.train()
    for part in net.modules():
        if isinstance(part, torch.nn.BatchNorm1d):
            part.eval()
    return net


def cmix_gan(**changes) -> CMixGan:
    torch.manual_seed(0)
    sizes = {name: size for name, size in TINY.items() if name != "style"}
    return CMixGan(MixGanConfig(**(sizes | changes)), pose=POSE, audio=AUDIO, speakers=1)


def make_extended(**changes) -> MixStageExtended:
    torch.manual_seed(0)
    return MixStageExtended(MixStageExtendedConfig(**(TINY | changes)), pose=POSE, audio=AUDIO, speakers=SPEAKERS)


def test_with_all_that_is_ours_off_it_is_the_published_model():
    paper, ours, data = network().train(), make_extended().train(), batch()
    ours.load_state_dict(paper.state_dict())
    for first, second in zip(paper.objectives().values(), ours.objectives().values(), strict=True):
        assert first.loss(data, 0) == second.loss(data, 0)


def test_less_reconstruction_played_poses_and_timing_change_what_they_say_and_nothing_else():
    data = batch()
    plain, less, persistent = (
        make_extended(**changes).train().generator_loss(data, 0)
        for changes in ({}, {"reconstruction": 0.25}, {"persistence": 6.0})
    )
    assert {name for name in plain if plain[name] != less[name]} == {"rec", "joint"}
    assert less["rec"].item() == pytest.approx(plain["rec"].item() / 4)
    assert {name for name in plain if plain[name] != persistent[name]} == {"id", "adv"}
    with_timing = make_extended(stroke_timing=3.0).train().generator_loss(data, 0)
    assert with_timing.keys() - plain.keys() == {"stroke_timing"}
    assert all(plain[name] == with_timing[name] for name in plain)
    assert 0 < with_timing["stroke_timing"].item() < 6


def test_statistics_are_of_the_poses_that_are_judged_and_move_the_network():
    """The weight times the mean distance of the mean pose, and of the deviations of pose, velocity and acceleration."""
    data, net = batch(), make_extended(motion_statistics=3.0, persistence=6.0).train()
    poses = net._decode_batch(batch(), 0).adversarial_poses
    terms = net.generator_loss(data, 0)
    assert terms.keys() - make_extended(persistence=6.0).train().generator_loss(data, 0).keys() == {"motion_statistics"}
    statistics, true_statistics = motion_statistics(poses), motion_statistics(data["pose"].mT)
    assert statistics.shape == (ROWS, 4 * poses.shape[1])
    assert terms["motion_statistics"].item() == pytest.approx(3 * (statistics - true_statistics).abs().mean().item(), rel=1e-4)
    slopes = torch.autograd.grad(terms["motion_statistics"], [*net.generators.parameters()])
    assert all(slope.abs().sum() > 0 for slope in slopes)


def test_the_style_joins_the_content_before_or_after_the_unet():
    """Sections 4 and 4.5 against the authors' code, which is the default."""
    for first in (False, True):
        net = network(style_first=first).eval()
        with torch.no_grad():
            content, style = net.audio_content(batch()["audio"]), torch.eye(SPEAKERS)[:1].expand(ROWS, 1, -1)
            z, row = net.latent(content, style), net.style(style).expand(-1, -1, 64)
            expected = net.unet(torch.cat([content, row], 1)) if first else torch.cat([net.unet(content), row], 1)
        assert torch.equal(z, expected)
        assert z.shape[1] == net.config.channels + (0 if first else net.config.style)


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
    "adv": {
        "audio_content",
        "unet",
        "style.matrix",
        "generators",
        "discriminator",
    },  # D has a gradient, but is not in the objective
}


def readings() -> dict[str, tuple[MixGan, dict[str, set[str]]]]:
    """Network → what each loss reaches; whole parts of it or nothing."""
    soft = {name: parts | ({"mode_logits"} if name != "mix" else set()) for name, parts in PAPER.items()}
    single = {name: parts - {"mode_logits"} for name, parts in PAPER.items() if name != "mix"}
    faceless = {name: parts - {"style.encoder", "style.matrix"} for name, parts in PAPER.items() if name != "id"}
    faceless_soft = {name: parts - {"style.encoder", "style.matrix"} for name, parts in soft.items() if name != "id"}
    return {
        "paper": (network(), PAPER),
        "authors": (network(**AUTHORS), soft),
        "stage": (network(modes=1), single),
        "stage, authors": (network(modes=1, **AUTHORS), single),
        "cmix-gan": (cmix_gan(), faceless),
        "cmix-gan, authors": (cmix_gan(**{k: v for k, v in AUTHORS.items() if k != "id_freezes"}), faceless_soft),
    }


@pytest.mark.parametrize("reading", readings())
def test_what_each_loss_reaches(reading):
    net, expected = readings()[reading]
    data = batch(modes=net.config.modes)
    for whole in (False, True):
        terms = freeze_statistics(net).generator_loss(data, 0)
        assert {name: parts_with_gradient(net, term, whole) for name, term in terms.items()} == expected
        terms_of_discriminator = net.discriminator_loss(data, 0)
        assert [parts_with_gradient(net, terms_of_discriminator[name], whole) for name in ("true", "false")] == [
            {"discriminator"}
        ] * 2
    own = {id(p) for p in net.objectives()["generator"].parameters}
    assert own == {id(p) for name, p in net.named_parameters() if part_of(name) != "discriminator"}
    if reading == "paper":
        assert set().union(*PAPER.values()) == set(PARTS)


@pytest.mark.parametrize("net", [network(), cmix_gan()], ids=["mix-stage", "cmix-gan"])
def test_of_every_frame_the_owner_alone_is_moved(net):
    """Frames of two owners: the others have no gradient at all, and of an owner none comes from the other's frames."""
    data = batch()
    cluster = torch.where(torch.arange(64) < 32, 0, 2).expand(ROWS, 64)
    outputs = []
    handle = net.generators.register_forward_hook(lambda module, given, output: outputs.append(output))
    terms = freeze_statistics(net).generator_loss(Batch({**data.arrays, "cluster": cluster}, data.chance), 0)
    handle.remove()
    of_speech, of_poses = outputs  # of speech, of poses
    for name, modes in (
        ("rec", of_speech),
        ("joint", of_poses),
        ("adv", of_speech),
        *((("id", of_speech),) if "id" in terms else ()),
    ):
        (gradient,) = torch.autograd.grad(terms[name], modes, retain_graph=True)
        size = gradient.abs().amax((0, 2))  # (M, T)
        assert (size[0, :32] > 0).all() or name == "adv"  # some frames lie between patches
        assert (size[2, 32:] > 0).all() or name == "adv"
        assert size[0, 32:].max() == size[2, :32].max() == size[[1, 3]].max() == 0
        assert size.max() > 0
    weights = torch.autograd.grad(sum(terms.values()), list(net.generators.parameters()))
    for gradient in weights:
        own = gradient.reshape(MODES, -1).abs().amax(1)
        assert own[1] == own[3] == 0
        assert min(own[0], own[2]) > 0


@pytest.mark.parametrize("freezes", [False, True])
def test_the_style_encoder_judges_generated_poses_frozen_or_not(freezes):
    net = network(id_freezes=freezes).train()
    poses = torch.randn(ROWS, POSE, 64, requires_grad=True)
    loss = net.style.recognise(poses).square().sum()
    assert torch.autograd.grad(loss, poses, retain_graph=True)[0].abs().max() > 0
    assert ("style.encoder" in parts_with_gradient(net, loss)) is not freezes


@pytest.mark.parametrize("make", [network, cmix_gan])
def test_batch_norms_count_what_plays_and_not_what_is_only_learnt_from(make):
    """Content of speech and recorded poses; not content of poses (equation 4), and not generated poses (equation 6)."""
    data, learner, player = batch(), make().train(), make().train()
    learner.generator_loss(data, 0)
    with torch.no_grad():
        own = player.style.see(data["pose"].mT)
        player.pose_content(data["pose"].mT)
        z = player.latent(player.audio_content(data["audio"]), own.weights)
        player._logits(z), player.generators(z)
    expected, counts = dict(player.named_buffers()), dict(learner.named_buffers())
    names = [name for name in expected if not name.startswith("discriminator.")]
    assert len(names) > 10
    assert all(torch.equal(expected[name], counts[name]) for name in names)


@pytest.mark.parametrize("make", [network, cmix_gan])
def test_what_the_discriminator_has_seen_made_is_not_made_again(make):
    """The generator's turn after the discriminator's: a decoding less, and the same losses and gradients to the bit."""
    data, results, passes = batch(), [], []
    for after_discriminator in (False, True):
        net = make().train()
        net.generators.register_forward_hook(lambda *_: passes.append(after_discriminator))  # noqa: B023  (called before the next round)
        if after_discriminator:
            net.discriminator_loss(data, 0)
        others = list(net.objectives()["generator"].parameters)
        terms = net.generator_loss(data, 0)
        results.append([*terms.values(), *torch.autograd.grad(sum(terms.values()), others)])
        net.generator_loss(data, 0)  # nothing is left over
        net.discriminator_loss(data, 0)
        later = net.eval().generator_loss(data, 0)["rec"]
        assert later.item() == make_again(net, data)
    assert all(torch.equal(*both) for both in zip(*results, strict=True))
    assert passes.count(True) == passes.count(False)


def make_again(net: MixGan, data: Batch) -> float:
    """L_rec of another batch object with the same arrays, so that no stored result can be used for it."""
    return net.generator_loss(Batch(data.arrays, StepRandom(0, 0)), 0)["rec"].item()


def test_objectives_share_out_all_parameters():
    net = network()
    judge, others = ({id(p) for p in objective.parameters} for objective in net.objectives().values())
    assert judge == {id(p) for p in net.discriminator.parameters()}
    assert not judge & others
    assert judge | others == {id(p) for p in net.parameters()}
    assert list(net.objectives()) == ["discriminator", "generator"]
    due = [[o.is_active_at(step) for o in network(alternate=True).objectives().values()] for step in range(4)]
    assert due == [[True, False], [False, True]] * 2


def test_a_curriculum_goes_from_pose_to_speech():
    net = network(curriculum=10).train()
    reach = {}
    for step in (0, 5, 10):
        terms = net.generator_loss(batch(step=step, rows=8), step)
        assert set(terms) == {"rec", "mix", "id", "adv"}
        reach[step] = parts_with_gradient(net, terms["rec"]) & {"audio_content", "pose_content"}
    assert reach == {0: {"pose_content"}, 5: {"audio_content", "pose_content"}, 10: {"audio_content"}}


def test_the_adversarial_terms_are_those_of_equation_7_or_of_the_authors():
    data = batch()
    discriminator_loss = network().eval().discriminator_loss(data, 0)
    generator_loss = network().eval().generator_loss(data, 0)["adv"]
    assert torch.allclose(discriminator_loss["false"], -generator_loss)  # what D maximises, the others minimise
    net = network(adversarial_loss="distance", growth=0.1).eval()
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
    change = net.generate(audio, torch.stack([eye[0]] * 25 + [eye[1]] * 25).unsqueeze(0))
    assert torch.equal(change[:, :19], one[:, :19])  # H's six kernels reach 6 frames ahead
    assert not torch.allclose(change[:, 30:], one[:, 30:], atol=1e-4)
    with pytest.raises(InputError, match="styles of shape"):
        net.generate(audio, eye[:2].view(1, 2, -1))
    with pytest.raises(InputError, match="speech of shape"):
        net.generate(audio[:, :0], eye[:1].view(1, 1, -1))


def test_style_of_a_clip_is_probabilities():
    style = network().eval().style_of(batch()["pose"])
    assert torch.allclose(style.sum(1), torch.ones(ROWS), atol=1e-6)


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
    torch.manual_seed(0)
    net, same = Stage(StageConfig(**TINY | {"modes": 1}), pose=POSE, audio=AUDIO, speakers=SPEAKERS), network(modes=1)
    assert StageConfig().modes == 1
    assert {name: p.shape for name, p in net.named_parameters()} == {name: p.shape for name, p in same.named_parameters()}
    data = batch(modes=1)
    terms, others = (one.eval().generator_loss(data, 0) for one in (net, same))
    assert {name: value.item() for name, value in terms.items()} == {name: value.item() for name, value in others.items()}
    assert set(terms) == {"rec", "joint", "id", "adv"}
    assert net.mode_logits is None


def test_without_style_it_is_cmix_gan():
    """The same parts but for Eˢₚ and S; Z is the U-Net's content, and it is for one speaker."""
    net, full = cmix_gan(), network()
    names = {part_of(name) for name, _ in full.named_parameters()} - {"style.encoder", "style.matrix"}
    assert {part_of(name) for name, _ in net.named_parameters()} == names
    assert net.generators.blocks[0][0].in_channels == net.mode_logits[0][0].in_channels == TINY["channels"]
    data = batch()
    with torch.no_grad():
        z = net.eval().latent(net.audio_content(data["audio"]), torch.zeros(ROWS, 1, 0))
        assert torch.equal(z, net.unet(net.audio_content(data["audio"])))
    assert set(net.generator_loss(data, 0)) == {"rec", "joint", "mix", "adv"}
    assert not net.encodes_style
    for speakers in (0, 2, 8):
        with pytest.raises(InputError, match=rf'{speakers} speakers.*speakers = \["NAME"\]'):
            CMixGan(MixGanConfig(), pose=POSE, audio=AUDIO, speakers=speakers)


@pytest.mark.parametrize("settings", [{}, {"soft": True}])
@pytest.mark.parametrize("make", [network, cmix_gan])
def test_losses_are_those_of_the_equations(make, settings):
    """Worked out again, frame by frame, from the parts."""
    net, data = freeze_statistics(make(**settings)), batch()
    pose = data["pose"].mT
    terms, terms_of_discriminator = net.generator_loss(data, 0), net.discriminator_loss(data, 0)
    weights = torch.zeros(ROWS, 1, 0)
    if isinstance(net, MixStage):
        logits = net.style.encoder(pose)
        weights = torch.eye(SPEAKERS)[logits.argmax(1)].unsqueeze(1)
    mixtures, guesses = {}, {}
    for name, content in (("rec", net.audio_content(data["audio"])), ("joint", net.pose_content(pose))):
        z = net.unet(content)
        if isinstance(net, MixStage):
            z = torch.cat([z, (weights @ net.style.matrix).mT.expand(-1, -1, 64)], 1)
        every, guesses[name] = net.generators(z), torch.softmax(net.mode_logits(z), 1)
        phi = guesses[name] if settings else torch.eye(MODES)[data["cluster"]].mT
        mixtures[name] = torch.einsum("bmdt,bmt->bdt", every, phi)
        assert terms[name].item() == pytest.approx((pose - mixtures[name]).abs().mean().item(), rel=1e-5)
    entropy = [-g.gather(1, data["cluster"].unsqueeze(1)).log().mean().item() for g in guesses.values()]
    assert terms["mix"].item() == pytest.approx(sum(entropy) / 2, rel=1e-5)
    poses = mixtures["rec"]
    motion = [torch.cat([torch.zeros_like(x[..., :1]), x[..., 1:] - x[..., :-1]], -1) for x in (pose, poses)]
    true, false = (torch.sigmoid(net.discriminator(x)) for x in motion)
    assert terms["adv"].item() == pytest.approx((1 - false).log().mean().item(), rel=1e-4)
    assert terms_of_discriminator["true"].item() == pytest.approx(-true.log().mean().item(), rel=1e-4)
    assert terms_of_discriminator["false"].item() == pytest.approx(-(1 - false).log().mean().item(), rel=1e-4)
    if isinstance(net, MixStage):
        both = [
            -torch.log_softmax(x, 1)[torch.arange(ROWS), data["speaker"]].mean() for x in (logits, net.style.encoder(poses))
        ]
        assert terms["id"].item() == pytest.approx(0.1 * sum(both).item(), rel=1e-5)


def test_sizes_at_paper_width():
    """The authors' layers, rebuilt: 15.32 M used with M = 8, 9.56 M with M = 1 and an H of one class; D .191 M.

    CMix-GAN lacks the style encoder, the matrix, and what its 10 numbers weigh in the sub-generators and in H.
    """
    count = {}
    with torch.device("meta"):
        for modes in (8, 1):
            net = MixStage(MixStageConfig(modes=modes), pose=96, audio=64, speakers=8)
            judge = sum(p.numel() for p in net.discriminator.parameters())
            assert judge == pytest.approx(191e3, rel=0.02)
            count[modes] = sum(p.numel() for p in net.parameters()) - judge
        idle = sum(p.numel() for p in ModeLogits(256 + 10, 256, 1).parameters())
        single = CMixGan(MixGanConfig(), pose=96, audio=64, speakers=1)
        encoder = sum(p.numel() for p in net.style.encoder.parameters())
    assert count == {8: 15_316_784, 1: 8_369_800}
    assert count[8] == pytest.approx(15.32e6, rel=1e-3)
    assert count[1] + idle == pytest.approx(9.56e6, rel=1e-3)
    weights_of_modes = 10 * 3 * (8 * 256 + 256)
    assert sum(p.numel() for p in single.parameters()) - judge == count[8] - encoder - 8 * 10 - weights_of_modes


def test_it_trains_from_a_store_of_key_points(tmp_path):
    """A run of the training loop: it computes clusters of the poses, balances speakers and stores the centres."""
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
