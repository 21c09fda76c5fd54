"""Parts of Mix-StAGE: shapes, laws and sizes."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.nn.content import AudioContent, PoseContent, StyleLogits  # noqa: E402
from cospeech.models.nn.mixture import ModeLogits, SubGenerators, mix, one_hot_priors  # noqa: E402
from cospeech.models.nn.patch import PatchDiscriminator, velocity  # noqa: E402
from cospeech.models.nn.unet1d import UNet1d  # noqa: E402

torch.set_num_threads(1)


def walk(*shape: int, seed: int = 0):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def test_u_net_keeps_its_shape_sees_far_and_says_what_lengths_it_takes():
    net = UNet1d(6, 3).eval()
    x = walk(2, 6, 24).requires_grad_()
    y = net(x)
    assert y.shape == x.shape
    y[0, :, 12].sum().backward()
    gradient = x.grad.abs().amax(1)
    assert gradient[1].max() == 0
    assert gradient[0].nonzero().min() == 0
    assert gradient[0].nonzero().max() == 23  # the bottom has three frames of 8, with kernels over them
    with pytest.raises(InputError, match="25 frames"):
        net(walk(1, 6, 25))


def test_u_net_adds_what_was_there_before_each_halving():
    net = UNet1d(2, 1).eval()
    with torch.no_grad():
        for value in net.down.parameters():
            value.zero_()  # nothing comes from below, so that all there is came by the skip
    x = walk(1, 2, 4)
    assert torch.allclose(net(x), net.up[0](net.first(x)))


@pytest.mark.parametrize("bands", [1, 16, 29, 64])
def test_audio_content_takes_any_number_of_bands_and_hears_all_of_them(bands):
    net = AudioContent(8).eval()
    audio = walk(2, 32, bands).requires_grad_()
    content = net(audio)
    assert content.shape == (2, 8, 32)
    content.square().sum().backward()
    assert (audio.grad.abs().amax((0, 1)) > 0).all()


def test_encoders_of_poses():
    poses = walk(2, 5, 64)
    assert PoseContent(5, 8)(poses).shape == (2, 8, 64)
    logits = StyleLogits(5, 8, 3)
    assert logits(poses).shape == (2, 3)
    assert logits(walk(2, 5, 200)).shape == (2, 3)
    with pytest.raises(InputError, match="63 frames"):
        logits(poses[..., :63])


def test_sub_generators_share_nothing():
    net = SubGenerators(7, 4, 5, 3)
    poses = net(walk(2, 7, 8))
    assert poses.shape == (2, 3, 5, 8)
    poses[:, 1].square().sum().backward()
    for value in net.parameters():
        own = value.grad.view(3, -1).abs().amax(1)
        assert own[0] == own[2] == 0
    assert net.out.weight.grad.view(3, -1).abs().amax(1)[1] > 0


def test_a_mixture_with_one_hot_priors_is_the_owner_of_each_frame():
    modes, cluster = walk(2, 3, 5, 8), torch.randint(3, (2, 8), generator=torch.Generator().manual_seed(1))
    priors = one_hot_priors(cluster, 3)
    assert torch.equal(priors.sum(1), torch.ones(2, 8))
    mixture = mix(modes, priors)
    assert all(torch.equal(mixture[b, :, t], modes[b, cluster[b, t], :, t]) for b in range(2) for t in range(8))
    even = mix(modes, torch.full((2, 3, 8), 1 / 3))
    assert torch.allclose(even, modes.mean(1), atol=1e-6)


def test_velocity_starts_at_zero_and_sums_to_the_way():
    pose = walk(2, 5, 9)
    steps = velocity(pose)
    assert steps[..., 0].abs().max() == 0
    assert torch.allclose(steps.sum(-1), pose[..., -1] - pose[..., 0], atol=1e-5)


def test_patches_of_64_frames_are_12_and_no_score_sees_all():
    net = PatchDiscriminator(5, 4).eval()
    x = walk(1, 5, 64).requires_grad_()
    scores = net(x)
    assert scores.shape == (1, 12)
    scores[0, 0].backward()
    assert 0 < len(x.grad.abs().amax(1)[0].nonzero()) < 40
    assert net(walk(1, 5, 20)).shape == (1, 1)
    with pytest.raises(InputError, match="19 frames"):
        net(walk(1, 5, 19))


@pytest.mark.parametrize(
    ("make", "count"),
    [  # the authors' layers at their widths, counted by hand: convolutions have biases, batch norms two numbers a channel
        (lambda: UNet1d(256, 5), 2_696_192),
        (lambda: PatchDiscriminator(96, 64), 190_657),
        (lambda: ModeLogits(266, 256, 8), 1_193_992),
    ],
)  # fmt: skip
def test_sizes_of_parts(make, count):
    with torch.device("meta"):
        assert sum(value.numel() for value in make().parameters()) == count
