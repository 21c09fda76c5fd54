"""TalkSHOW: each term of its losses by hand, what the prior sees, what is drawn."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from torch import nn  # noqa: E402
from torch.nn import functional as F  # noqa: E402

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.nn.coder import Down, Up  # noqa: E402
from cospeech.models.nn.pixel_cnn import GatedPixelCnn  # noqa: E402
from cospeech.models.nn.quantise import Quantiser  # noqa: E402
from cospeech.models.nn.temporal import Memory  # noqa: E402
from cospeech.models.talkshow import TalkShow, TalkShowConfig, pick  # noqa: E402
from tests.models.test_contract import ROWS, batch, network, ready, train_windowed  # noqa: E402

torch.set_num_threads(1)
HANDS = [*range(39, 129)]  # 39 numbers of a body and 90 of hands, as in the authors' code


def count(module: nn.Module) -> int:
    return sum(value.numel() for value in module.parameters())


# codes ---------------------------------------------------------------------------------------------------------------------


def test_a_vector_becomes_the_nearest_code_and_its_gradient_passes():
    quantiser = Quantiser(3, 2, commitment=0.25).eval()
    quantiser.codes.copy_(torch.tensor([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]]))
    z = torch.tensor([[[0.9, 0.1], [0.1, 1.2]]], requires_grad=True)  # (1, 2, 2): vectors (0.9, 0.1) and (0.1, 1.2)
    nearest, commitment = quantiser(z)
    assert quantiser.indices(z).tolist() == [[1, 2]]
    torch.testing.assert_close(nearest, torch.tensor([[[1.0, 0.0], [0.0, 2.0]]]))
    by_hand = 0.25 * (0.1**2 + 0.1**2 + 0.1**2 + 0.8**2) / 4
    assert commitment.item() == pytest.approx(by_hand, rel=1e-5)
    (gradient,) = torch.autograd.grad((nearest * torch.tensor([3.0, 5.0])).sum(), z, retain_graph=True)
    torch.testing.assert_close(gradient, torch.tensor([[[3.0, 5.0], [3.0, 5.0]]]))
    (gradient,) = torch.autograd.grad(commitment, z)
    torch.testing.assert_close(gradient, 0.25 * 2 / 4 * (z - nearest).detach())


def test_codes_become_the_means_of_the_vectors_that_they_stand_for():
    torch.manual_seed(0)
    centres = torch.tensor([[3.0, 0.0], [-3.0, 1.0], [0.0, -4.0]])
    quantiser = Quantiser(3, 2, decay=0.5).train()
    for _ in range(30):
        z = centres[torch.randint(3, (8, 5))] + 0.01 * torch.randn(8, 5, 2)
        quantiser(z.mT)
    means = quantiser.codes[quantiser.codes[:, 0].argsort(descending=True)]
    torch.testing.assert_close(means, centres[centres[:, 0].argsort(descending=True)], atol=0.05, rtol=0)


def test_codes_that_nobody_uses_are_put_where_vectors_are():
    torch.manual_seed(0)
    quantiser = Quantiser(16, 2).train()
    z = 5 + torch.randn(4, 2, 20)
    for _ in range(60):
        quantiser(z)
    assert len(quantiser.indices(z).unique()) > 12
    before = quantiser.codes.clone()
    quantiser.eval()(z)
    assert torch.equal(quantiser.codes, before)


def test_the_autoencoder_s_loss_is_the_papers():
    net = ready("talkshow")
    data = batch(net)
    terms = net.code_loss(data, 0)
    for name, coder, columns in zip(("body", "hands"), net.coders, net.columns, strict=True):
        pose = data["pose"][..., columns].mT
        z = coder.down(pose)
        nearest = torch.cdist(z.mT, coder.quantiser.codes.expand(len(z), -1, -1)).argmin(-1)
        output = coder.up(coder.quantiser.codes[nearest].mT)
        assert terms[name].item() == pytest.approx((pose - output).abs().mean().item(), rel=1e-5)
        step = (pose[..., 1:] - pose[..., :-1]) - (output[..., 1:] - output[..., :-1])
        assert terms[f"{name}_velocity"].item() == pytest.approx(step.abs().mean().item(), rel=1e-5)
        off = 0.25 * (z - coder.quantiser.codes[nearest].mT).square().mean()
        assert terms[f"{name}_commitment"].item() == pytest.approx(off.item(), rel=1e-5)


# the prior -----------------------------------------------------------------------------------------------------------------


def test_the_prior_s_loss_is_the_cross_entropy_of_both_codes():
    net = ready("talkshow")
    data = batch(net)
    codes = net.encode(data["pose"])
    who = F.one_hot(data["speaker"], ROWS).float().unsqueeze(-1).expand(-1, -1, codes.shape[1])
    logits = net.prior.logits(codes, net.hear(data["audio"].mT), who)
    terms = net.prior_loss(data, 0)
    for k, name in enumerate(("body", "hands")):
        share = logits[k].softmax(1).gather(1, codes[..., k].unsqueeze(1))
        assert terms[name].item() == pytest.approx(-share.log().mean().item() / 2, rel=1e-5)


def test_a_code_depends_on_the_codes_before_it_and_on_no_other():
    """The order: row by row, and within a row the body before the hands."""
    torch.manual_seed(0)
    prior = GatedPixelCnn(codes=5, width=6, layers=4, speech=3, styles=2).eval()
    codes, speech = torch.randint(5, (1, 7, 2)), torch.randn(1, 3, 7)
    style = torch.tensor([[1.0], [0.0]]).expand(1, 2, 7)
    before = torch.stack(prior.logits(codes, speech, style), -1)  # (1, K, T, 2)
    for row, column in ((0, 0), (2, 1), (4, 0), (6, 1)):
        other = codes.clone()
        other[0, row, column] = (other[0, row, column] + 1) % 5
        has_changed = (torch.stack(prior.logits(other, speech, style), -1) - before).abs().amax(1)[0] > 1e-7
        place = torch.arange(14).view(7, 2)
        assert not has_changed[place <= 2 * row + column].any()
        assert has_changed.flatten()[2 * row + column + 1 : 2 * row + column + 5].all()


def test_a_layer_is_the_gate_of_the_paper():
    torch.manual_seed(0)
    prior = GatedPixelCnn(codes=5, width=4, layers=2, speech=3, styles=2).eval()
    layer = prior.layers[1]
    v, h, style = [torch.randn(1, 4, 6) for _ in range(2)], [torch.randn(1, 4, 6) for _ in range(2)], torch.randn(1, 2, 6)
    vertical, horizontal = layer(v, h, style, Memory())
    kernel = torch.zeros(8, 4, 2, 3)  # a picture's: rows above and own, columns left, own and right
    kernel[..., 1], kernel[..., 0], kernel[..., 2] = layer.own.weight, layer.left.weight, layer.right.weight
    picture = torch.stack(v, -1)
    sums = F.conv2d(F.pad(picture, (1, 1, 1, 0)), kernel, layer.own.bias)
    of_style = layer.style(style).unsqueeze(-1)

    def gate(x):
        return torch.tanh(x[:, :4]) * torch.sigmoid(x[:, 4:])

    torch.testing.assert_close(torch.stack(vertical, -1), gate(sums + of_style))
    for j in range(2):
        x = layer.to_horizontal(sums[..., j]) + of_style[..., 0] + layer.same(h[j])
        x = x + layer.before(h[0]) if j else x
        torch.testing.assert_close(horizontal[j], layer.out(gate(x)) + h[j])


def test_row_by_row_the_prior_gives_what_it_gives_at_once():
    net = ready("talkshow")
    codes, speech = torch.randint(net.config.codes, (2, 6, 2)), torch.randn(2, net.heard, 6)
    who = torch.eye(ROWS)[:2].unsqueeze(-1).expand(-1, -1, 6)
    with torch.no_grad():
        whole, rows = torch.stack(net.prior.logits(codes, speech, who), -1), net.prior.embed(codes)
        states, above = [], [torch.zeros_like(x[..., :1]) for x in rows]
        for t in range(6):
            here, memory = [x[..., t : t + 1] for x in rows], Memory(states)
            logits = net.prior(above, here, speech[..., t : t + 1], who[..., t : t + 1], memory)
            torch.testing.assert_close(torch.cat(logits, -1), whole[:, :, t], atol=1e-5, rtol=1e-5)
            states, above = memory.new_states, here


# what is drawn -------------------------------------------------------------------------------------------------------------


def test_codes_are_drawn_with_their_probabilities():
    shares = torch.tensor([0.5, 0.125, 0.375])
    uniform = (torch.arange(1000) + 0.5) / 1000
    codes = pick(shares.log().expand(1000, -1), uniform)
    assert codes.bincount().tolist() == [500, 125, 375]
    assert pick(shares.log()[None].flip(1), torch.zeros(1)).item() == 2  # the most likely


def test_takes_differ_and_go_on_from_known_codes():
    net = train_windowed("talkshow")
    arrays = batch(net).arrays
    draw = torch.Generator().manual_seed(3)
    noises = [torch.rand(ROWS, net.window, 2, generator=draw) for _ in range(2)]
    one, other, again = (net.play(arrays, noise=noise)["pose"] for noise in (*noises, noises[0]))
    assert (one - other).abs().mean() > 1e-3
    assert torch.equal(one, again)
    assert torch.equal(net.play(arrays)["pose"], net.play(arrays)["pose"])
    speech, who = net.hear(arrays["audio"].mT), torch.eye(ROWS).unsqueeze(-1).expand(-1, -1, net.window // 4)
    first_codes = torch.randint(net.config.codes, (ROWS, 3, 2))
    assert torch.equal(net.draw(speech, who, torch.rand(ROWS, 9, 2), first_codes)[:, :3], first_codes)


def test_of_the_poses_the_first_four_are_looked_at_and_no_others():
    net = train_windowed("talkshow")
    arrays = dict(batch(net).arrays)
    later = arrays | {"pose": torch.cat([arrays["pose"][:, :4], arrays["pose"][:, 4:] + 1], 1)}
    assert torch.equal(net.play(arrays)["pose"], net.play(later)["pose"])
    for lacking in ("seed", "speaker"):
        assert net.play(arrays, (lacking,))["pose"].shape == arrays["pose"].shape
    with pytest.raises(InputError, match="faces"):
        net.play(arrays, ("faces",))


def test_known_poses_are_encoded_as_long_as_the_windows_of_training():
    net = train_windowed("talkshow")
    arrays, prefixes = batch(net).arrays, []
    draw = net.draw
    net.draw = lambda speech, who, noise, prefix: prefixes.append(prefix) or draw(speech, who, noise, prefix)
    net.play(arrays)
    poses = torch.cat([arrays["pose"][:, :4], arrays["pose"][:, 3:4].expand(-1, net.window - 4, -1)], 1)
    assert torch.equal(prefixes[0], net.encode(poses)[:, :1])
    assert net.preliminary_steps == net.config.prior_from


def test_a_face_is_made_of_the_speech_in_the_speaker_s_manner():
    net = train_windowed("talkshow")
    data = batch(net)
    face = net.play(data.arrays)["face"]
    assert face.shape == (ROWS, net.window, 52)
    assert face.min() >= 0
    assert face.max() <= 1
    other = dict(data.arrays, speaker=data["speaker"].roll(1))
    assert (net.play(other)["face"] - face).abs().max() > 1e-3
    who = F.one_hot(data["speaker"], ROWS).float().unsqueeze(-1).expand(-1, -1, net.window)
    by_hand = (net.face(data["audio"].mT, who).mT - data["face"]).square().mean()
    assert net.face_loss(data, 0)["face"].item() == pytest.approx(by_hand.item(), rel=1e-5)
    data.arrays["face"][:] = torch.nan
    assert net.face_loss(data, 0)["face"].item() == 0


# what is trained when, and sizes --------------------------------------------------------------------------------------------


def test_the_second_stage_leaves_the_first_alone():
    net = network("talkshow").train()
    objectives = net.objectives()
    first = net.config.prior_from
    assert [name for name, each in objectives.items() if each.is_active_at(first - 1)] == ["codes", "face"]
    assert [name for name, each in objectives.items() if each.is_active_at(first)] == ["prior", "face"]
    before = {key: value.clone() for key, value in net.body.state_dict().items()}
    sum(net.prior_loss(batch(net), first).values()).backward()
    assert all(value.grad is None for value in net.body.parameters())
    assert all(torch.equal(value, before[key]) for key, value in net.body.state_dict().items())
    assert net.body.training


def test_sizes_that_are_none_are_told():
    for changes, hint in (({"frames": 86}, "86"), ({"speech_encoder": "wave"}, "wave"), ({"layers": 1}, "layers")):
        with pytest.raises(InputError, match=hint):
            TalkShowConfig(**changes)
    for hands in ([], [0, 1, 2]):
        with pytest.raises(InputError, match="hands"):
            TalkShow(TalkShowConfig.tiny(), pose=3, audio=4, speakers=2, hands=hands)


@pytest.mark.slow
def test_parameters_at_paper_size_are_the_authors_but_for_what_is_masked():
    """Yi et al. 2023, authors' code, by hand of its widths: 39 numbers of a body, 90 of hands, 64 of speech, four speakers."""

    def conv(a, b, kernel):
        return a * b * kernel + b

    def stack(width):  # two convolutions and one more, a batch norm after each
        return 3 * (conv(width, width, 3) + 2 * width)

    def down(inputs, width):
        halves = [(width // 4, width // 2), (width // 2, width)]
        total = conv(inputs, width // 4, 3) + width // 2 + stack(width // 4)
        return total + sum(2 * conv(a, b, 4) + 2 * b + stack(b) for a, b in halves)

    def up(inputs, width, outputs):
        halves = [(width, width // 2), (width // 2, width // 4)]
        total = conv(inputs, width, 1) + stack(width) + conv(width // 4, outputs, 1)
        return total + sum(2 * conv(a, b, 4) + 2 * b + stack(b) for a, b in halves)

    coders = sum(down(part, 1024) + conv(1024, 64, 1) + up(64, 1024, part) for part in (39, 90))
    rows = [4, *[2] * 14]
    prior = 2048 * 256 + conv(256, 256, 1) + 2 * conv(512, 256, 1) + conv(256, 512, 1) + conv(512, 2048, 1)
    prior += sum(4 * 512 + conv(256, 512, 3 * k) + conv(512, 512, 1) + conv(256, 512, 2) + conv(256, 256, 1) for k in rows)
    weights_of_masks = (
        3 * 256 * 512 + 256 * 512 + 15 * 512
    )  # of the first layer its own row, its own column; biases that stand twice
    with torch.device("meta"):
        net = TalkShow(TalkShowConfig(), pose=129, audio=64, speakers=4, hands=HANDS)
        assert count(Down(64, 256)) == down(64, 256)
        assert count(Up(64, 1024, 39)) == up(64, 1024, 39)
    assert (coders, down(64, 256), prior) == (70_997_761, 1_119_872, 23_522_816)
    assert sum(map(count, net.coders)) == coders
    assert count(net.speech) == down(64, 256)
    assert count(net.prior) == prior - weights_of_masks
