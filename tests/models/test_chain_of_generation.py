"""Chain of Generation and its streaming variant: stages, what may be missing, what each loss is, streams, stores."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.audio.features.frames import AUDIO_NAMES  # noqa: E402
from cospeech.audio.features.words import GRAMS  # noqa: E402
from cospeech.corpora.store import Entry, Store  # noqa: E402
from cospeech.corpora.store_writer import Piece, write_store  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.models.chain_live import ChainLive, ChainLiveConfig  # noqa: E402
from cospeech.models.chain_of_generation import INPUTS, ChainConfig, ChainOfGeneration  # noqa: E402
from cospeech.models.chain_of_generation_extended import ChainExtendedConfig, ChainOfGenerationExtended  # noqa: E402
from cospeech.models.nn.channel_attention import ChannelAttention, PastAttention  # noqa: E402
from cospeech.models.nn.contrast import info_nce  # noqa: E402
from cospeech.models.nn.gesture_norm import GestureAdaLN, HyperNetwork  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.models.nn.recurrent import BothWays, Forwards  # noqa: E402
from cospeech.models.nn.speed_distance import speed_distance, timing_distance  # noqa: E402
from cospeech.models.nn.temporal import CausalConv, Memory, SameConv, TextTcn  # noqa: E402
from cospeech.models.nn.words import SubwordTable, word_embedding  # noqa: E402
from cospeech.models.speech_classifier import SpeechClassifier, SpeechClassifierConfig  # noqa: E402
from cospeech.motion.poses import find_pose  # noqa: E402
from cospeech.motion.poses.joints import hand_columns  # noqa: E402
from cospeech.training.calibration_clips import STRETCH, STRETCHES  # noqa: E402
from cospeech.training.checkpoint import load_run, read_tensors  # noqa: E402
from cospeech.training.recipe import SHIPPED, build, load_recipe, read_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402
from cospeech.training.windows import Windows  # noqa: E402

torch.set_num_threads(1)
POSE, AUDIO, SPEAKERS, ROWS, FRAMES = 7, 5, 3, 4, 24
HANDS = [2, 3, 6]
SMALL = {
    "frames": FRAMES, "latent": 8, "hidden": 6, "layers": 2, "reduction": 4, "word_width": 5, "text_channels": 6,
    "classifier_channels": 6, "dropout": 0.0,
}  # fmt: skip


def make_published(seed: int = 0, **changes) -> ChainOfGeneration:
    torch.manual_seed(seed)
    config = ChainConfig(**(SMALL | changes))
    return ChainOfGeneration(config, pose=POSE, audio=AUDIO, speakers=SPEAKERS, hands=HANDS)


def chain(seed: int = 0, **changes) -> ChainOfGenerationExtended:
    """A small network with our extensions, which are off unless ``changes`` turn them on."""
    torch.manual_seed(seed)
    config = ChainExtendedConfig(**(SMALL | changes))
    return ChainOfGenerationExtended(config, pose=POSE, audio=AUDIO, speakers=SPEAKERS, hands=HANDS)


def live(seed: int = 0, teacher=None, **changes) -> ChainLive:
    torch.manual_seed(seed)
    config = ChainLiveConfig(**(SMALL | {"look_ahead": 3, "pooling_window": 5} | changes))
    return ChainLive(config, pose=POSE, audio=AUDIO, speakers=SPEAKERS, hands=HANDS, teacher=teacher)


def arrays(frames: int = FRAMES, seed: int = 1, rows: int = ROWS) -> dict:
    draw = torch.Generator().manual_seed(seed)
    return {
        "pose": torch.randn(rows, frames, POSE, generator=draw).cumsum(1) / 3,
        "audio": torch.randn(rows, frames, AUDIO, generator=draw),
        "text": torch.randint(1, 2000, (rows, frames, GRAMS), generator=draw),
        "face": torch.rand(rows, frames, 52, generator=draw),
        "emotion": torch.randint(0, 8, (rows, 1), generator=draw).repeat(1, frames),
        "speaker": torch.arange(rows) % SPEAKERS,
    }


def batch(net, seed: int = 1, step: int = 0, **changes) -> Batch:
    return Batch(arrays(net.window, seed) | changes, StepRandom(0, step))


def parts_with_gradient(net, terms: dict) -> set[str]:
    """First names of the parameters that a gradient reaches."""
    parameters = dict(net.named_parameters())
    total = torch.stack([*terms.values()]).sum()
    gradients = torch.autograd.grad(total, [*parameters.values()], allow_unused=True)
    return {name.split(".")[0] for name, g in zip(parameters, gradients, strict=True) if g is not None and g.abs().max() > 0}


# stages ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [chain, live])
@pytest.mark.parametrize("label_conditioning", [0.0, 0.5, 1.0])
def test_the_second_stage_leaves_the_classifier_exactly_as_it_is(make, label_conditioning):
    net = make(
        adversarial=1.0,
        discriminator_channels=4,
        noise=2,
        label_conditioning=label_conditioning,
        speech_swap=0.3,
        motion_statistics=1.0,
    ).train()
    data = batch(net)
    parts = net.objectives()
    assert [*parts] == ["classifier", "discriminator", "gestures"]
    assert parts_with_gradient(net, parts["classifier"].loss(data, 0)) == {"classifier"}
    assert parts_with_gradient(net, parts["discriminator"].loss(data, 0)) >= {"discriminator"}
    for value in net.classifier.parameters():
        value.grad = None
    sum(parts["gestures"].loss(data, 0).values()).backward()
    assert all(value.grad is None for value in net.classifier.parameters())
    assert parts_with_gradient(net, parts["gestures"].loss(batch(net), 0)) == {
        "speech_encoder",
        "word",
        "cascade",
        "rhythm",
        "discriminator",
    }
    own = {id(p) for p in net.classifier.parameters()}
    assert not own & {id(p) for name in ("discriminator", "gestures") for p in parts[name].parameters}


def test_the_first_stage_ends_where_the_second_begins():
    parts = chain(classifier_steps=5, adversarial=1.0).objectives()
    due = [{name for name, part in parts.items() if part.is_active_at(step)} for step in (0, 4, 5, 900)]
    assert due == [{"classifier"}, {"classifier"}, {"discriminator", "gestures"}, {"discriminator", "gestures"}]


def test_what_was_made_for_the_judge_is_what_the_chain_is_judged_for():
    net = chain(adversarial=1.0, noise=2, dropout=0.4).train()
    data = batch(net)
    net.discriminator_loss(data, 0)
    poses = net._shared_forward[1].output.pose
    calls = []
    net.terms = lambda batch, turn: calls.append(turn.output.pose) or {}
    net.gesture_loss(data, 0)
    assert calls[0] is poses
    assert net._shared_forward is None


# equations ------------------------------------------------------------------------------------------------------------


def test_info_nce_is_what_equation_6_says():
    draw = np.random.default_rng(0)
    face, speech = draw.normal(size=(2, 3, 4, 9))
    loss = 0.0
    for f, a in zip(face, speech, strict=True):
        for i in range(9):
            likeness = [f[:, i] @ a[:, j] / np.linalg.norm(f[:, i]) / np.linalg.norm(a[:, j]) / 0.1 for j in range(9)]
            loss -= likeness[i] - np.log(np.exp(likeness).sum())
    measure = info_nce(torch.from_numpy(face), torch.from_numpy(speech), 0.1)
    assert measure.item() == pytest.approx(loss / 27, rel=1e-9)
    same = torch.from_numpy(face)
    assert info_nce(same, same, 1e-3) < 1e-6 < info_nce(same, same.flip(2), 1e-3)


def test_a_style_of_zeros_changes_nothing_and_others_scale_and_shift():
    torch.manual_seed(0)
    norm, x = GestureAdaLN(6, 4), torch.randn(2, 6, 9)
    assert torch.equal(norm(x, torch.zeros(2, 4, 9)), x)
    style = torch.randn(2, 4, 1).expand(-1, -1, 9)
    scale, shift = (norm(torch.full_like(x, v), style) for v in (1.0, 0.0))
    assert torch.allclose(norm(x, style), (scale - shift) * x + shift, atol=1e-5)
    assert (scale - shift - 1).abs().min() > 1e-4


def test_the_style_of_a_mixture_lies_on_the_way_between():
    torch.manual_seed(0)
    net, zero = HyperNetwork(3, 8, 4, SameConv), torch.zeros(1, 11, 7)
    ends = []
    for speaker in (0, 2):
        weights = zero.clone()
        weights[:, speaker] = weights[:, 3] = 1
        ends.append(
            (
                weights,
                net.convs.convs[0](torch.cat([net.speakers @ weights[:, :3], net.emotions @ weights[:, 3:]], 1), Memory()),
            )
        )
    half = (ends[0][0] + ends[1][0]) / 2
    middle = net.convs.convs[0](torch.cat([net.speakers @ half[:, :3], net.emotions @ half[:, 3:]], 1), Memory())
    assert torch.allclose(middle, (ends[0][1] + ends[1][1]) / 2, atol=1e-6)
    assert net(half, Memory()).shape == (1, 4, 7)


def test_channels_are_let_through_by_their_mean_and_maximum():
    torch.manual_seed(0)
    net, x = ChannelAttention(8, 4), torch.randn(2, 8, 11)
    narrow, wide = ((layer.weight[..., 0], layer.bias) for layer in (net.gate.narrow, net.gate.wide))
    weight = sum((p @ narrow[0].T + narrow[1]).relu() @ wide[0].T + wide[1] for p in (x.mean(2), x.amax(2))).sigmoid()
    assert torch.allclose(net(x, Memory()), x * weight[..., None], atol=1e-6)
    past = PastAttention(8, 4, 5)
    past.load_state_dict(net.state_dict())
    padded = torch.cat([torch.zeros(2, 8, 4), x], 2)
    for t in (0, 3, 10):
        alone = net(padded[..., t : t + 5], Memory())[..., -1]
        assert torch.allclose(past(x, Memory())[..., t], alone, atol=1e-6)


def test_two_directions_are_summed():
    torch.manual_seed(0)
    net, x = BothWays(3, 4, 2, 0.0), torch.randn(2, 3, 9)
    out, _ = net.lstm(x.mT)
    assert torch.equal(net(x, Memory()), (out[..., :4] + out[..., 4:]).mT)
    one = torch.nn.LSTM(3, 4, batch_first=True)
    first = BothWays(3, 4, 1, 0.3)
    for name, value in one.named_parameters():
        for suffix in ("", "_reverse"):
            getattr(first.lstm, name + suffix).data.copy_(value.data)
    ahead, back = one(x.mT)[0], one(x.mT.flip(1))[0].flip(1)
    assert torch.allclose(first(x, Memory()), (ahead + back).mT, atol=1e-6)


def test_with_all_that_is_ours_off_it_is_the_published_model():
    paper, ours = make_published().train(), chain().train()
    assert {name: value.shape for name, value in paper.state_dict().items()} == {
        name: value.shape for name, value in ours.state_dict().items()
    }
    data = batch(paper)
    assert [*paper.objectives()] == [*ours.objectives()] == ["classifier", "gestures"]
    for stage in ("classifier", "gestures"):
        torch.manual_seed(1)
        first = paper.objectives()[stage].loss(data, 0)
        torch.manual_seed(1)
        assert first == ours.objectives()[stage].loss(data, 0)
    one, other = (net.eval().play(data.arrays)["pose"] for net in (paper, ours))
    torch.testing.assert_close(one, other, rtol=0, atol=1e-6)  # PyTorch's last bit is not the same twice on every processor


def test_the_losses_are_those_of_equation_9():
    net = chain(reconstruction=2.0, hands=3.0, face=5.0, rhythm=7.0).eval()
    data = batch(net)
    with torch.no_grad():
        terms = net.gesture_loss(data, 0)
        output = net.play(data.arrays)
        raw = net._turn(data)
    pose, body = data["pose"], [k for k in range(POSE) if k not in HANDS]
    apart = (output["pose"] - pose).abs()
    assert terms["body"] == pytest.approx(2 * apart[..., body].mean().item(), rel=1e-5)
    assert terms["hands"] == pytest.approx(6 * apart[..., HANDS].mean().item(), rel=1e-5)
    assert terms["face"] == pytest.approx(5 * (raw.output.face.mT - data["face"]).square().mean().item(), rel=1e-5)
    codes = net.rhythm.face(raw.features), net.rhythm.speech(raw.audio)
    assert terms["rhythm"] == pytest.approx(7 * info_nce(*codes, 0.1).item(), rel=1e-5)
    assert torch.equal(output["face"], raw.output.face.mT.clamp(0, 1))
    assert [*terms] == ["body", "hands", "face", "rhythm"]


def test_faces_that_nobody_recorded_teach_nothing():
    net = chain(face=5.0).eval()
    true = arrays()["face"]
    for rows in (slice(0, 1), slice(0, ROWS)):
        face = true.clone()
        face[rows] = torch.nan
        data = batch(net, face=face)
        term = net.gesture_loss(data, 0)["face"]
        output = net._turn(data).output.face.mT
        apart = 5 * (output - true).square()
        apart[rows] = 0
        assert term.item() == pytest.approx(apart.mean().item(), rel=1e-5, abs=1e-9)
        assert all(p.grad is None or p.grad.isfinite().all() for p in net.parameters())


# what may be missing --------------------------------------------------------------------------------------------------


def moves(net, name: str, lacks=(), given=("face", "emotion", "speaker")) -> bool:
    """Whether the poses change when an array has another value."""
    data, other = arrays(), arrays(seed=2)
    if name == "speaker":
        other["speaker"] = (data["speaker"] + 1) % SPEAKERS
    if name == "emotion":
        other["emotion"] = (data["emotion"] + 1) % 8
    output = net.play(data | {name: other[name]}, lacks, given=given)
    return not torch.equal(output["pose"], net.play(data, lacks, given=given)["pose"])


@pytest.mark.parametrize("make", [chain, live])
@pytest.mark.parametrize(("what", "array"), [*zip(INPUTS, ("text", "face", "emotion", "speaker", "pose"), strict=True)])
def test_what_is_missing_does_not_matter_and_what_is_given_does(make, what, array):
    net = make(seeds=4).eval()
    assert moves(net, array)
    assert not moves(net, array, lacks=(what,))
    output = net.play(arrays(), lacks=(what,), given=("face", "emotion", "speaker"))
    assert output["pose"].shape == (ROWS, FRAMES, POSE)
    assert output["pose"].isfinite().all()
    assert output["face"].shape == (ROWS, FRAMES, 52)
    assert 0 <= output["face"].min() <= output["face"].max() <= 1


def test_as_published_face_mood_and_speaker_are_made_of_the_speech():
    net = chain().eval()
    data = arrays()
    plain = net.play(data)["pose"]
    for name in ("face", "emotion", "speaker"):
        assert not moves(net, name, given=())
    bare = {name: data[name] for name in ("audio", "text", "pose")}
    assert torch.equal(net.play(bare)["pose"], plain)
    least = net.play({"audio": data["audio"]}, lacks=("text", "seed"))
    assert least["pose"].isfinite().all()
    unknown = data | {"emotion": torch.full_like(data["emotion"], -1), "face": torch.full_like(data["face"], torch.nan)}
    assert torch.equal(net.play(unknown, given=("emotion", "face"))["pose"], plain)


def test_a_face_that_is_given_is_the_face_that_is_shown():
    net, data = chain().eval(), arrays()
    data["face"][0] = torch.nan
    faces, own = net.play(data, given=("face",))["face"], net.play(data)["face"]
    assert torch.equal(faces[1:], data["face"][1:])
    assert torch.equal(faces[0], own[0])
    for wrong in ({"lacks": ("faces",)}, {"given": ("word",)}):
        with pytest.raises(InputError, match="no input"):
            net.play(data, **wrong)


def test_only_the_first_four_poses_are_seeds():
    net = chain().eval()
    data, later, first = arrays(), arrays(), arrays()
    later["pose"][:, 4:] += 1
    first["pose"][:, 3] += 1
    assert torch.equal(net.play(data)["pose"], net.play(later)["pose"])
    assert not torch.equal(net.play(data)["pose"], net.play(first)["pose"])


def test_what_is_played_without_seeds_is_made():
    for net in (chain(noise=2).eval(), live(noise=2, seeds=2).eval()):
        data, noise = arrays(), torch.randn(ROWS, FRAMES, 2)
        rows = torch.cat([data["audio"], net.words(data["text"])], 2)
        style = net.estimate_style(data["audio"]).unsqueeze(1).expand(-1, FRAMES, -1)
        with torch.no_grad():
            poses = net.make(rows, style, noise)
        assert torch.equal(poses, net.play(data, lacks=("seed",), noise=noise)["pose"])
        assert (poses - net.play(data, lacks=("seed",))["pose"]).abs().max() > 1e-3


def steady(**changes) -> ChainOfGeneration:
    """A network in training mode without random numbers of its own."""
    net = chain(**changes).train()
    net.cascade.text.input_dropout.p = 0.0
    return net


@pytest.mark.parametrize(
    ("share", "array"),
    [
        ("word_dropout", "text"),
        ("seed_dropout", "pose"),
        ("label_conditioning", "speaker"),
        ("label_conditioning", "emotion"),
        ("face_teacher_forcing", "face"),
    ],
)
def test_shares_of_clips_lack_or_are_given_something_in_training(share, array):
    for value in (0.0, 1.0):
        net = steady(**{share: value})
        data = batch(net)
        other = arrays(seed=2)[array] if array != "speaker" else (data["speaker"] + 1) % SPEAKERS
        if array == "emotion":
            other = (data["emotion"] + 1) % 8
        first, second = (net._turn(Batch(data.arrays | more, StepRandom(0, 0))).output.pose for more in ({}, {array: other}))
        matters = (value == 0.0) if share in ("word_dropout", "seed_dropout") else (value == 1.0)
        assert torch.equal(first, second) is not matters
    half = steady(**{share: 0.5})
    poses = [half._turn(Batch(batch(half).arrays, StepRandom(0, step))).output.pose for step in (0, 0, 1)]
    assert torch.equal(poses[0], poses[1])
    assert not torch.equal(poses[0], poses[2])


def test_who_borrows_speech_keeps_style_and_manner_and_is_compared_with_no_recording():
    net = chain(speech_swap=1.0, adversarial=1.0, motion_statistics=2.0).train()
    data = batch(net)
    turn = net._turn(data)
    for name in ("audio", "text", "face"):
        assert torch.equal(turn.inputs[name], data[name].roll(1, 0))
    for name in ("pose", "emotion", "speaker"):
        assert torch.equal(turn.inputs[name], data[name])
    assert torch.equal(turn.style[:, :SPEAKERS, 0].argmax(1), data["speaker"])
    assert torch.equal(turn.style[:, SPEAKERS:, 0].argmax(1), data["emotion"][:, 0])
    assert not turn.own.any()
    terms = net.terms(data, turn)
    assert terms["body"] == terms["hands"] == 0
    assert terms["adv"] > 0
    expected = 0.0
    for output, pose in zip(turn.output.pose.mT.detach().double().numpy(), data["pose"].double().numpy(), strict=True):
        expected += np.abs(output.mean(0) - pose.mean(0)).mean() + np.abs(output.std(0) - pose.std(0)).mean()
        for order, weight in ((1, 3), (2, 9)):
            expected += weight * np.abs(np.diff(output, order, 0).std(0) - np.diff(pose, order, 0).std(0)).mean()
    assert terms["motion_statistics"].item() == pytest.approx(2 * expected / ROWS / 4, rel=1e-2)
    half = chain(speech_swap=0.5).train()
    assert 0 < half._turn(Batch(arrays(rows=30), StepRandom(0, 0))).own.sum() < 30
    assert half.eval()._turn(data).own.all()


def test_unknown_moods_teach_the_classifier_of_speakers_alone():
    torch.manual_seed(0)
    net = SpeechClassifier(SpeechClassifierConfig(frames=12, channels=6), audio=AUDIO, speakers=SPEAKERS)
    data = arrays(12)
    data["emotion"][1] = -1
    terms = net.loss(Batch(data, StepRandom(0, 0)), 0)
    who, how = (x.mean(1).log_softmax(1) for x in net(data["audio"]).split((SPEAKERS, 8), 2))
    labels = [0, 2, 3]
    assert terms["emotion"].item() == pytest.approx(-how[labels, data["emotion"][labels, 0]].sum().item() / ROWS, rel=1e-5)
    assert terms["speaker"].item() == pytest.approx(-who[range(ROWS), data["speaker"]].mean().item(), rel=1e-5)
    none = net.loss(Batch(data | {"emotion": torch.full((ROWS, 12), -1)}, StepRandom(0, 0)), 0)
    assert none["emotion"] == 0
    figures = net.validate(Batch(data, StepRandom(0, 0)))
    wrong = (how.argmax(1) != data["emotion"][:, 0])[labels].float().mean()
    assert figures["wrong_emotion"].item() == pytest.approx(wrong.item())
    weights = net.weights(data["audio"])
    assert torch.allclose(weights.split((SPEAKERS, 8), 1)[0].sum(1), torch.ones(ROWS))
    assert torch.allclose(weights[:, SPEAKERS:], how.exp(), atol=1e-6)
    other = data["audio"].clone()
    other[:, : 6 - net.reach] += 1
    other[:, 7 + net.reach :] += 1
    assert torch.allclose(net(other)[:, 6], net(data["audio"])[:, 6], atol=1e-6)


# as speech comes ------------------------------------------------------------------------------------------------------


def rows_of(net, frames: int, seed: int = 5) -> list:
    draw = torch.Generator().manual_seed(seed)
    return [torch.randn(2, frames, width, generator=draw) for width in (net.audio, net.styles, net.modes)]


@pytest.mark.parametrize("layers", [1, 3])
def test_piece_by_piece_it_makes_what_it_makes_of_the_whole(layers):
    net = live(noise=3, layers=layers).eval()
    given = rows_of(net, 61)
    with torch.no_grad():
        whole = net.make(*given)
    inputs = [torch.cat([x, x[:, -1:].expand(-1, 3, -1)], 1) for x in given]
    for cuts in ([1] * 64, [7, 1, 30, 26], [64]):
        states, pieces = [], []
        for x in zip(*(x.split(cuts, 1) for x in inputs), strict=True):
            poses, states = net.step(*x, states)
            pieces.append(poses)
        assert torch.allclose(torch.cat(pieces, 1)[:, 3:], whole, atol=1e-5)


def test_the_future_beyond_the_look_ahead_does_not_matter_and_within_it_does():
    net = live(noise=3).eval()
    given = rows_of(net, 40)
    with torch.no_grad():
        before = net.make(*given)
        for which in range(3):
            other = [x.clone() for x in given]
            other[which][:, 20 + 3 + 1 :] += 1
            assert torch.equal(net.make(*other)[:, :21], before[:, :21])
            other[which][:, 20 + 3] += 1
            assert (net.make(*other)[:, 20] - before[:, 20]).abs().max() > 1e-5
        both = chain(noise=3).eval()
        later = [given[0].clone(), *given[1:]]
        later[0][:, 39] += 1
        assert (both.make(*later)[:, 0] - both.make(*given)[:, 0]).abs().max() > 1e-9


@pytest.mark.parametrize("layer", [CausalConv(3, 4, 3), CausalConv(3, 4, 2, 4), TextTcn(3, 6, 4, 0.3), PastAttention(3, 2, 6),
                                   Forwards(3, 4, 2, 0.3)], ids=["conv", "dilated", "words", "attention", "lstm"])  # fmt: skip
def test_causal_layers_play_in_pieces_and_see_no_future(layer):
    layer.eval()
    x = torch.randn(2, 3, 30, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        whole = layer(x, Memory())
        memory, parts = Memory(), []
        for piece in x.split([1, 1, 5, 2, 21], 2):
            memory = Memory(memory.new_states)
            parts.append(layer(piece, memory))
        assert torch.allclose(torch.cat(parts, 2), whole, atol=1e-6)
        later = x.clone()
        later[..., 12:] += 1
        assert torch.equal(layer(later, Memory())[..., :12], whole[..., :12])


def test_the_student_learns_what_its_teacher_makes_of_the_same():
    teacher = chain(3, noise=2).eval().requires_grad_(False)
    net = live(1, teacher, noise=2, distillation=2.0).train()
    data = batch(net)
    assert net.classifier is teacher.classifier
    assert net.word is teacher.word
    parts = net.objectives()
    assert [*parts] == ["gestures"]
    own = {id(p) for p in teacher.parameters()}
    assert not own & {id(p) for p in parts["gestures"].parameters}
    assert not teacher.training
    turn = net._turn(Batch(data.arrays, StepRandom(0, 0)))
    terms = net.gesture_loss(Batch(data.arrays, StepRandom(0, 0)), 0)
    now = {name: value[:, :FRAMES] for name, value in data.arrays.items() if name != "speaker"}
    rows = torch.cat([now["audio"], net.words(now["text"])], 2)
    with torch.no_grad():
        target = teacher.make(rows, turn.style.mT[:, :FRAMES], turn.noise.mT[:, 3:])
    apart = (turn.output.pose.mT - target).abs()
    assert terms["teacher_hands"].item() == pytest.approx(2 * apart[..., HANDS].mean().item(), rel=1e-4)
    sum(terms.values()).backward()
    assert all(p.grad is None for p in teacher.parameters())
    with pytest.raises(InputError, match="teacher"):
        live(1, teacher, noise=3)


# sizes ----------------------------------------------------------------------------------------------------------------


def test_poses_come_in_the_order_of_their_columns():
    net = chain().eval()
    with torch.no_grad():
        for decoder, value in ((net.cascade.body, 1.0), (net.cascade.hands, 2.0)):
            decoder.mlp[-1].weight.zero_()
            decoder.mlp[-1].bias.fill_(value)
        poses = net.play(arrays())["pose"]
    assert torch.equal(poses[0, 0], torch.tensor([2.0 if k in HANDS else 1.0 for k in range(POSE)]))


def test_words_are_the_mean_of_their_rows_and_silence_is_zero():
    torch.manual_seed(0)
    net = SubwordTable(4)
    ids = torch.zeros(1, 3, GRAMS, dtype=torch.long)
    ids[0, 1, :3] = torch.tensor([5, 9, 5])
    vectors_of_words = net(ids)
    assert torch.equal(vectors_of_words[0, [0, 2]], torch.zeros(2, 4))
    assert torch.allclose(vectors_of_words[0, 1], net.table.weight[[5, 9, 5]].mean(0))
    vectors = torch.randn(1, 3, 6)
    assert word_embedding(6, 4)(vectors) is vectors
    net = ChainOfGeneration(ChainConfig(**SMALL), pose=POSE, audio=AUDIO, speakers=2, hands=HANDS, text=6).eval()
    data = arrays() | {"text": torch.randn(ROWS, FRAMES, 6)}
    assert net.audio == AUDIO + 6
    assert net.play(data)["pose"].shape == (ROWS, FRAMES, POSE)


def test_sizes_that_do_not_fit_are_told():
    base = ChainExtendedConfig(**SMALL)
    for wrong in (
        {"frames": 4},
        {"speech_encoder": "left"},
        {"noise": -1},
        {"hidden": 0},
        {"frames": 10, "adversarial": 1.0},
        {"seeds": -1},
    ):
        with pytest.raises(InputError):
            ChainOfGenerationExtended(replace(base, **wrong), pose=POSE, audio=AUDIO, speakers=2, hands=HANDS)
    for hands in ([], [*range(POSE)], [1, 1], [9]):
        with pytest.raises(InputError, match="hands"):
            ChainOfGeneration(base, pose=POSE, audio=AUDIO, speakers=2, hands=hands)
    for wrong in ({"look_ahead": 0}, {"pooling_window": 1}):
        with pytest.raises(InputError, match="look-ahead"):
            live(**wrong)
    with pytest.raises(InputError, match="odd"):
        SpeechClassifier(SpeechClassifierConfig(kernel=4), audio=AUDIO, speakers=2)


def test_louder_speech_is_heard_in_training_alone_and_by_all():
    steps = [0.5, 1.0, 0.0, 0.0, 0.25]
    torch.manual_seed(0)
    config = ChainExtendedConfig(**(SMALL | {"gain_augmentation": 12.0, "adversarial": 1.0}))
    net = ChainOfGenerationExtended(config, pose=POSE, audio=AUDIO, speakers=SPEAKERS, hands=HANDS, louder=steps).train()
    data = batch(net)
    turn = net._turn(data)
    more = (turn.recording["audio"] - data["audio"]) / torch.tensor(steps)
    shift = more[:, :1, :1].expand(-1, FRAMES, -1)
    assert torch.allclose(more[..., [0, 1, 4]], shift.expand(-1, -1, 3), atol=1e-5)
    assert torch.equal(turn.recording["audio"][..., 2:4], data["audio"][..., 2:4])
    assert shift[:, 0, 0].abs().max() <= 1.2
    assert len({round(value.item(), 4) for value in shift[:, 0, 0]}) == ROWS
    assert torch.equal(turn.inputs["audio"], turn.recording["audio"])
    assert torch.equal(net.eval()._turn(data).recording["audio"], data["audio"])
    for wrong in ({"gain_augmentation": -1.0}, {"gain_augmentation": 3.0}):
        with pytest.raises(InputError, match="louder"):
            chain(**wrong)
    classifier = SpeechClassifier(
        SpeechClassifierConfig(channels=4, gain_augmentation=6.0), audio=AUDIO, speakers=2, louder=steps
    )
    clip = Batch(arrays(34) | {"speaker": torch.zeros(ROWS, dtype=torch.long)}, StepRandom(0, 0))
    assert classifier.train().loss(clip, 0)["emotion"] != classifier.eval().loss(clip, 0)["emotion"]


@pytest.mark.parametrize(("text", "count"), [(300, 15_543_853), (0, 16_144_153)])
def test_parameters_at_paper_size(text, count):
    hands = hand_columns(find_pose("euler").names)
    assert len(hands) == 114
    with torch.device("meta"):
        net = ChainOfGeneration(ChainConfig(), pose=141, audio=24, speakers=4, hands=hands, text=text)
    assert sum(value.numel() for value in net.parameters()) == count
    assert (sum(v.numel() for v in net.cascade.body.parameters()), sum(v.numel() for v in net.cascade.hands.parameters())) == (
        6_372_891,
        6_908_402,
    )


def test_gesture_features_are_the_lstms_or_128_of_them():
    """Section 4.1 has 128 gesture features, CaMN's code the 256 numbers of its LSTM: B̂ and Ĥ are of either width."""
    hands = hand_columns(find_pose("euler").names)
    parameters = {}
    for width in (0, 128):
        with torch.device("meta"):
            net = ChainOfGeneration(ChainConfig(gesture_features=width), pose=141, audio=24, speakers=4, hands=hands, text=300)
        assert net.cascade.hand_attention.gate.narrow.in_channels == 3 * 128 + (width or 256)
        assert net.cascade.hands.mlp[0].in_channels == (width or 256)
        parameters[width] = sum(value.numel() for value in net.parameters())
    assert parameters == {0: 15_543_853, 128: 15_244_957}
    with pytest.raises(InputError):
        chain(gesture_features=-1)


def test_hands_are_found_by_the_names_of_their_columns():
    assert len(hand_columns(find_pose("expmap-humanoid").names)) == 18
    assert len(hand_columns(find_pose("rot6d-smplx").names)) == 6 * 2 * 16
    for name in ("direction-vectors", "keypoints2d"):
        with pytest.raises(InputError, match="hands"):
            hand_columns(find_pose(name).names)


# stores ---------------------------------------------------------------------------------------------------------------


def make_spoken_store(folder):
    """A store with words, faces and moods, of which some clips lack some."""
    draw = np.random.default_rng(0)
    pieces, at = [], {"a": ("face", "emotion", "word"), "b": ("emotion", "word"), "c": ()}
    for split in ("train", "validation"):
        for name, has in at.items():
            values = {
                "pose": draw.normal(size=(60, POSE)), "audio": draw.normal(size=(60, 84)), "face": np.full((60, 52), np.nan),
                "emotion": np.full(60, -1), "word": np.full(60, -1),
            }  # fmt: skip
            optional = {"face": draw.uniform(size=(60, 52)), "emotion": np.full(60, 3), "word": np.arange(60) // 20}
            values |= {key: optional[key] for key in has}
            types = {"emotion": np.int8, "word": np.int32}
            values = {key: value.astype(types.get(key, np.float32)) for key, value in values.items()}
            entry = Entry(f"{name}-{split}", name, split, 0, 60, 0.0, ("pose", "audio", *has))
            own_arrays = {key: values[key] for key in entry.has}
            pieces.append(Piece(entry, ("yes", "no"), lambda own_arrays=own_arrays: dict(own_arrays)))
    columns = ("hips.x", "hips.y", "leftHand.rx", "leftGrip.0", "spine.rx", "head.rx", "rightHand.rx")
    names = {"pose": columns, "audio": AUDIO_NAMES, "face": tuple(map(str, range(52)))}
    write_store(folder, pieces, corpus="beat", pose="none", fps=15.0, names=names)
    return folder


def recipe(name: str, needs: dict | None = None, data: dict | None = None, **config):
    sections = {
        "model": {"name": name, **config}, "needs": needs or {}, "data": {"audio": "mel20-prosody", **(data or {})},
        "train": {"steps": 4, "batch": 6, "threads": 1, "device": "cpu", "validate_every": 2, "save_every": 2},
    }  # fmt: skip
    return read_recipe(sections)


def test_it_learns_of_a_store_whose_clips_lack_this_and_that(tmp_path):
    store = make_spoken_store(tmp_path / "store")
    config = SMALL | {"classifier_steps": 2, "gain_augmentation": 6.0, "adversarial": 1.0, "noise": 2}
    train(recipe("chain-of-generation-extended", **config), store, tmp_path / "run")
    net, facts = load_run(tmp_path / "run")
    assert facts["sizes"]["hands"] == [2, 3, 6]
    assert facts["sizes"]["text"] == 0
    std = read_tensors(tmp_path / "run" / "statistics.safetensors")[0]["audio_std"].numpy()
    steps = np.array([np.log(10)] * 20 + [10, 0, 0, 0]) / std
    assert np.allclose(facts["sizes"]["louder"], steps, rtol=1e-5)
    examples, _ = read_tensors(tmp_path / "run" / "examples.safetensors")
    assert examples["texts"].shape == (3, STRETCHES, STRETCH, GRAMS)
    assert examples["emotions"].shape == (3, STRETCHES, STRETCH, 1)
    assert {*examples["emotions"][:, :, :60].unique().tolist()} == {-1.0, 3.0}
    assert (examples["texts"][0].sum(-1) > 0).any()
    assert not examples["texts"][2].any()
    live_config = SMALL | {"look_ahead": 3, "noise": 2}
    train(recipe("chain-of-generation-live", {"teacher": str(tmp_path / "run")}, **live_config), store, tmp_path / "live")
    student, _ = load_run(tmp_path / "live")
    for name, value in net.classifier.state_dict().items():
        assert torch.equal(value, student.classifier.state_dict()[name])
        assert torch.equal(value, student.teacher.classifier.state_dict()[name])
    assert torch.equal(student.word.table.weight, net.word.table.weight)
    with pytest.raises(InputError, match="louder"):
        train(recipe("chain-of-generation-extended", data={"audio": "mel29-linear"}, **config), store, tmp_path / "powers")


def test_a_clip_may_lack_what_is_spare(tmp_path):
    store = Store(make_spoken_store(tmp_path / "store"))
    arrays = ("pose", "audio", "face", "emotion")
    assert len(Windows(store, 24, arrays)) == 37
    whole = Windows(store, 24, arrays, spare=("face", "emotion"))
    assert len(whole) == 3 * 37
    windows = whole.at(60, 0, 0)
    lacking = np.isnan(windows["face"]).all((1, 2))
    assert (windows["speaker"][~lacking] == 0).all()
    assert {0, 1, 2} == {*windows["speaker"]}
    assert (windows["emotion"][windows["speaker"] == 2] == -1).all()
    with pytest.raises(InputError, match="no 'cluster'"):
        Windows(store, 24, ("pose", "cluster"), spare=("cluster",))


def test_the_recipe_of_the_paper_is_at_the_values_of_the_paper():
    file = SHIPPED / "chain_of_generation_beat.toml"
    of_paper = load_recipe(file)
    assert build(ChainConfig, of_paper.config, "model") == ChainConfig()
    assert (of_paper.data.pose, of_paper.data.fps) == ("euler", 15)
    assert (of_paper.train.batch, of_paper.train.lr) == (512, 2.5e-4)


def test_a_pause_costs_speed_and_the_shape_of_a_stroke_does_not():
    time = torch.arange(40) / 15
    moving, other = torch.sin(6 * time).expand(2, 4, -1), -torch.sin(6 * time).expand(2, 4, -1)
    assert speed_distance(other, moving).item() == pytest.approx(0, abs=1e-6)
    assert speed_distance(torch.zeros_like(moving), moving).item() == pytest.approx(1, abs=0.05)
    net = chain(speed_envelope=2.0).train()
    terms = net.gesture_loss(batch(net), 0)
    assert terms["speed_envelope"].item() > 0


def test_no_speed_is_wrong_where_no_recording_has_the_speech():
    net = chain(speed_envelope=2.0, speech_swap=0.5).train()
    examples = batch(net)
    turn = net._turn(examples)
    (slopes,) = torch.autograd.grad(net.terms(examples, turn)["speed_envelope"], turn.output.pose)
    own = turn.own.flatten()
    assert own.any()
    assert not own.all()
    assert slopes[own].any()
    assert not slopes[~own].any()


def test_strokes_at_other_times_cost_timing_and_strokes_of_another_size_and_form_do_not():
    """A pulse of speed every 1.2 s: at the same times in another direction and size, half a period later, and not at all."""
    time = torch.arange(64) / 15

    def strokes(shift, size):
        return size * torch.tanh(6 * torch.sin(2 * torch.pi * (time - shift) / 2.4)).expand(2, 4, -1)

    recording = strokes(0.0, 1.0)
    assert timing_distance(-0.5 * recording, recording).item() < 0.05
    assert timing_distance(strokes(0.6, 1.0), recording).item() > 1.3
    assert timing_distance(torch.zeros_like(recording), recording).item() == pytest.approx(1, abs=0.01)
    net = chain(stroke_timing=2.0).train()
    gradients = torch.autograd.grad(net.gesture_loss(batch(net), 0)["stroke_timing"], net.objectives()["gestures"].parameters,
                                    allow_unused=True)  # fmt: skip
    assert any(each is not None and each.abs().max() > 0 for each in gradients)
