"""The GestureDiffuCLIP-like network: each term of its losses by hand, diffusion, styles by label and by example."""

from __future__ import annotations

from math import pi

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from torch.nn import functional as F  # noqa: E402

from cospeech.audio.emotions import EMOTIONS  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.models.gesturediffuclip import LATENT_NOISE, GestureDiffuClip, GestureDiffuClipConfig  # noqa: E402
from cospeech.models.nn.contrast import choice_nce  # noqa: E402
from cospeech.models.nn.diffusion import add_noise, denoise, level_features, velocity  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.models.nn.transformer import StyledTransformer  # noqa: E402
from tests.models.test_contract import AUDIO, POSE, ROWS, batch, network, ready, train_windowed  # noqa: E402

torch.set_num_threads(1)


# diffusion -----------------------------------------------------------------------------------------------------------------


def test_noise_and_velocity_are_two_sides_of_an_angle():
    z, noise = torch.randn(3, 4, 5), torch.randn(3, 4, 5)
    angle = torch.tensor([0.0, 0.7, pi / 2])
    x, v = add_noise(z, noise, angle), velocity(z, noise, angle)
    torch.testing.assert_close(x[0], z[0])
    torch.testing.assert_close(x[2], noise[2], atol=1e-6, rtol=0)
    torch.testing.assert_close(v[1], torch.cos(angle[1]) * noise[1] - torch.sin(angle[1]) * z[1])
    cos, sin = angle.cos().view(3, 1, 1), angle.sin().view(3, 1, 1)
    torch.testing.assert_close(cos * x - sin * v, z, atol=1e-6, rtol=0)
    torch.testing.assert_close(sin * x + cos * v, noise, atol=1e-6, rtol=0)
    features = level_features(torch.tensor([0.3]), 2)[0]
    torch.testing.assert_close(features, torch.tensor([0.3, 0.6, 0.3, 0.6]).cos() * torch.tensor([1, 1, 0, 0])
                               + torch.tensor([0.3, 0.6, 0.3, 0.6]).sin() * torch.tensor([0, 0, 1, 1]))  # fmt: skip


@pytest.mark.parametrize("steps", [1, 4, 50])
def test_with_the_true_velocity_the_data_come_out(steps):
    z, noise = torch.randn(2, 6, 3), torch.randn(2, 6, 3)

    def truth(x, angle):
        return velocity(z, noise, torch.full((2,), angle))

    torch.testing.assert_close(denoise(truth, noise, steps), z, atol=1e-4, rtol=0)
    start = torch.randn(2, 2, 3)
    latents = denoise(truth, noise, steps, start)
    torch.testing.assert_close(latents[:, :2], start, atol=1e-6, rtol=0)


def test_of_normal_data_the_deviation_comes_out():
    """The best estimate for data of N(0, s²) is known; the sampler then makes data of this deviation."""
    size = 0.3

    def best(x, angle):
        a, b = torch.cos(torch.tensor(angle)), torch.sin(torch.tensor(angle))
        total = a * a * size * size + b * b
        return (a * b - b * a * size * size) * x / total  # cos φ E[ε | x] − sin φ E[z | x]

    samples = denoise(best, torch.randn(4000, 1, 1, generator=torch.Generator().manual_seed(0)), 200)
    assert samples.std().item() == pytest.approx(size, rel=0.05)


def test_the_diffusion_s_loss_is_the_velocity_s():
    net = ready("gesturediffuclip")
    data = batch(net)
    z, chance = net.encode(data["pose"]), StepRandom(0, 0)
    with torch.no_grad():
        style = net._training_style(Batch(data.arrays, chance))
        angle, noise = pi / 2 * chance.uniform(ROWS), chance.normal(ROWS, *z.shape[1:])
        condition = torch.cat([net.speech(data["audio"].mT), net.read(data["text"])], 1)
        cos, sin = angle.cos().view(-1, 1, 1), angle.sin().view(-1, 1, 1)
        estimate = net._estimate(condition, style, cos * z + sin * noise, angle)
    by_hand = (estimate - (cos * noise - sin * z)).square().mean()
    assert net.diffusion_loss(data, 0)["velocity"].item() == pytest.approx(by_hand.item(), rel=1e-5)


# autoencoder and contrast ---------------------------------------------------------------------------------------------------


def test_the_autoencoder_s_loss_is_the_distance_of_shaken_latents():
    net = ready("gesturediffuclip")
    data = batch(net)
    pose, z = data["pose"].mT, net.encode(data["pose"])
    poses = net.up(z + LATENT_NOISE * StepRandom(0, 0).normal(ROWS, *z.shape[1:]))
    terms = net.motion_loss(data, 0)
    assert terms["pose"].item() == pytest.approx((poses - pose).abs().mean().item(), rel=1e-5)
    step = (poses[..., 1:] - poses[..., :-1]) - (pose[..., 1:] - pose[..., :-1])
    assert terms["velocity"].item() == pytest.approx(step.abs().mean().item(), rel=1e-5)


def test_latents_are_as_large_as_the_noise():
    net = network("gesturediffuclip").train()
    for part in net.modules():
        if isinstance(part, torch.nn.BatchNorm1d):
            part.momentum = None  # a plain average
    with torch.no_grad():
        for seed in range(4):
            net.motion_loss(batch(net, seed, rows=16), 0)
    z = torch.cat([net.encode(batch(net, seed, rows=16)["pose"]) for seed in range(4)])
    assert z.std().item() == pytest.approx(1, abs=0.1)


def test_the_contrastive_loss_of_labels_is_a_softmax_of_cosines():
    torch.manual_seed(0)
    queries, keys, labels = torch.randn(4, 6), torch.randn(3, 6), torch.tensor([0, 2, -1, 1])
    cosines = F.cosine_similarity(queries[:, None], keys[None], dim=-1) / 0.2
    shares = cosines.softmax(1)
    by_hand = -(shares[0, 0].log() + shares[1, 2].log() + shares[3, 1].log()) / 4
    assert choice_nce(queries, keys, labels, 0.2).item() == pytest.approx(by_hand.item(), rel=1e-4)


def test_the_contrastive_loss_of_words_and_gestures_is_symmetrical():
    net = ready("gesturediffuclip")
    data = batch(net)
    words, gestures = net.read(data["text"]), net.gesture(net.encode(data["pose"]))
    cosines = F.cosine_similarity(words.mT[:, :, None], gestures.mT[:, None], dim=-1) / net.config.temperature
    own = cosines.diagonal(dim1=1, dim2=2)
    by_hand = ((cosines.logsumexp(2) - own).mean() + (cosines.logsumexp(1) - own).mean()) / 2
    assert net.align_loss(data, 0)["words"].item() == pytest.approx(by_hand.item(), rel=1e-4)


# styles --------------------------------------------------------------------------------------------------------------------


def test_labels_become_styles_and_styles_become_motion():
    net = train_windowed("gesturediffuclip")
    codes = net.label_styles()
    assert tuple(codes) == EMOTIONS
    assert len({tuple(code.tolist()) for code in codes.values()}) == len(EMOTIONS)
    for name, code in codes.items():
        assert torch.equal(code, net.style_of_label(name))
        assert code.square().mean().item() == pytest.approx(1, rel=1e-3)
    one_hot = torch.eye(len(EMOTIONS))
    torch.testing.assert_close(net.labels(torch.zeros(8, ROWS), one_hot), torch.stack([*codes.values()]), atol=1e-4, rtol=1e-4)
    assert not net.labels(torch.zeros(1, ROWS), torch.zeros(1, 8)).any()
    assert net.style_of_label("").isfinite().all()
    arrays = dict(batch(net).arrays)
    arrays["emotion"][:] = 1
    poses = net.play(arrays)["pose"]
    for lacking in ("emotion", "speaker", "text", "seed"):
        assert (net.play(arrays, (lacking,))["pose"] - poses).abs().mean() > 1e-4
    other = arrays | {"emotion": torch.full_like(arrays["emotion"], 2)}
    assert (net.play(other)["pose"] - poses).abs().mean() > 1e-4
    with pytest.raises(InputError, match="faces"):
        net.play(arrays, ("faces",))


def test_takes_differ_by_their_noise_alone():
    net = train_windowed("gesturediffuclip")
    arrays = batch(net).arrays
    draw = torch.Generator().manual_seed(3)
    noises = [torch.randn(ROWS, net.window, net.modes, generator=draw) for _ in range(2)]
    one, other, again = (net.play(arrays, noise=noise)["pose"] for noise in (*noises, noises[0]))
    assert (one - other).abs().mean() > 1e-2
    assert torch.equal(one, again)
    assert torch.equal(net.play(arrays)["pose"], net.play(arrays)["pose"])


def test_known_poses_are_encoded_as_long_as_the_windows_of_training():
    net = train_windowed("gesturediffuclip")
    arrays, prefixes = batch(net).arrays, []
    draw = net.draw
    net.draw = lambda features, style, noise, prefix: prefixes.append(prefix) or draw(features, style, noise, prefix)
    net.play(arrays)
    poses = torch.cat([arrays["pose"][:, :4], arrays["pose"][:, 3:4].expand(-1, net.window - 4, -1)], 1)
    assert torch.equal(prefixes[0], net.encode(poses)[..., :1].mT)
    assert net.preliminary_steps == net.config.diffusion_from


def test_layers_normalise_a_step_and_are_steered():
    torch.manual_seed(0)
    net = StyledTransformer(5, 3, width=8, words=4, layers=2, heads=2).eval()
    x, words, style = torch.randn(2, 5, 7), torch.randn(2, 4, 7), torch.randn(2, 8, 7)
    output = net(x, words, style)
    assert output.shape == (2, 3, 7)
    norm = net.norm
    scale, shift = norm.style(style).chunk(2, 1)
    features = torch.randn(2, 8, 7)
    expected = (1 + scale) * F.layer_norm(features.mT, (8,)).mT + shift
    torch.testing.assert_close(norm(features, style), expected, atol=1e-5, rtol=1e-5)
    attend = net.blocks[0].attend
    query, key, value = ((f(features).unflatten(1, (2, 4))).mT for f in (attend.query, attend.key, attend.value))
    by_hand = F.scaled_dot_product_attention(query, key, value).mT.flatten(1, 2)
    torch.testing.assert_close(attend(features, features), attend.out(by_hand), atol=1e-5, rtol=1e-5)
    for k, other in enumerate((x + 1, words + 1, style + 1)):
        given = [x, words, style]
        given[k] = other
        assert (net(*given) - output).abs().max() > 1e-3


# what is trained when, and sizes --------------------------------------------------------------------------------------------


def test_each_stage_leaves_those_before_alone():
    net = network("gesturediffuclip").train()
    c, objectives = net.config, net.objectives()
    for step, name in ((0, "motion"), (c.align_from, "align"), (c.diffusion_from, "diffusion")):
        assert [key for key, each in objectives.items() if each.is_active_at(step)] == [name]
    before = {key: value.clone() for key, value in net.state_dict().items()}
    for name in ("align", "diffusion"):
        net.zero_grad()
        sum(objectives[name].loss(batch(net), c.diffusion_from).values()).backward()
        names = {key for key, value in net.named_parameters() if value.grad is not None}
        assert names <= {key for key, value in net.named_parameters() if any(value is p for p in objectives[name].parameters)}
    earlier = {key: value for key, value in net.state_dict().items() if not key.startswith("speech.")}  # trained now
    assert all(torch.equal(value, before[key]) for key, value in earlier.items())
    assert net.training
    assert net.reader.training


def test_sizes_that_are_none_are_told():
    for changes, hint in (({"frames": 34}, "34"), ({"heads": 3}, "3 heads"), ({"diffusion_from": 5}, "diffusion_from")):
        with pytest.raises(InputError, match=hint):
            GestureDiffuClipConfig(**changes)
    with pytest.raises(InputError, match="0 speakers"):
        GestureDiffuClip(GestureDiffuClipConfig.tiny(), pose=POSE, audio=AUDIO, speakers=0)


def test_parameters_are_those_of_the_page():
    with torch.device("meta"):
        net = GestureDiffuClip(GestureDiffuClipConfig(), pose=141, audio=24, speakers=4)
    sizes = {name: sum(p.numel() for p in part.parameters()) for name, part in net.named_children()}
    assert sizes["down"] + sizes["up"] == 8_974_157
    assert sum(sizes[name] for name in ("embedding", "reader", "gesture", "labels", "example")) == 3_223_000
    assert sizes["speech"] + sizes["denoiser"] == 12_805_824
    assert sum(sizes.values()) == 25_002_981
