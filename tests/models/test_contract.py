"""What every network must do. The tests iterate over the registries. Flows must do more: see the end.

``NAME+VARIANT`` is a network in another configuration.
"""

from __future__ import annotations

from contextlib import contextmanager
from copy import deepcopy
from dataclasses import replace
from functools import cache, wraps
from importlib import import_module
from inspect import signature

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from safetensors.torch import load_file, save_file  # noqa: E402

from cospeech.audio.features.words import BUCKETS, GRAMS  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.models import ENTRIES, NETWORKS  # noqa: E402
from cospeech.models.audio2gestures import Audio2Gestures  # noqa: E402
from cospeech.models.chain_of_generation import ChainOfGeneration  # noqa: E402
from cospeech.models.nn.modalities import ManyInputs  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.models.nn.sampled import Sampled  # noqa: E402
from cospeech.models.nn.seeded_windows import SeededWindows  # noqa: E402
from cospeech.models.nn.windowed import Windowed  # noqa: E402

torch.set_num_threads(1)
POSE, AUDIO, ROWS = 6, 5, 3


@contextmanager
def plain_convolutions():
    """Convolutions without oneDNN: what it does before it begins takes longer than networks this small."""
    before, torch.backends.mkldnn.enabled = torch.backends.mkldnn.enabled, False
    try:
        yield
    finally:
        torch.backends.mkldnn.enabled = before


@pytest.fixture(autouse=True)
def _plain_convolutions():
    with plain_convolutions():
        yield


_FLOW = {"hidden": 8, "history": 4, "look_ahead": 2, "frames": 4}
_MIX = {"depth": 3, "patch_channels": 4}
_MANY = {"frames": 12, "speaker": 3}
_CONTEXT = _MANY | {"adversarial_from": 2640}
_CHAIN = {"frames": 10, "reduction": 4, "text_channels": 6, "classifier_steps": 2000}
_OBJECTIVES_OF_PLAY = {
    "frames": 22,
    "noise": 3,
    "adversarial": 1.0,
    "discriminator_channels": 4,
    "reconstruction": 5.0,
    "face": 5.0,
}
_OBJECTIVES_OF_PLAY |= {
    "word_dropout": 0.5,
    "seed_dropout": 0.5,
    "label_conditioning": 0.5,
    "face_teacher_forcing": 0.5,
    "speech_swap": 0.3,
    "motion_statistics": 1.0,
    "speed_distribution": 1.0,
    "part_correlation": 1.0,
    "part_timing": 1.0,
}
_BEAT = {"frames": 34, "code": 16, "widening": 2, "difference": 0.0, "velocity": 0.1}
_STYLE = {"encoder": False, "style": 3, "style_window": 12, "residual": True, "inertia": 0.5, "steps_seen": True}
CHANGES = {
    "gesture-autoencoder": {"frames": 18},
    "fgd-autoencoder": {"frames": 18, "hidden": 16},
    "fgd-autoencoder+beat": _BEAT,
    "stylised-flow": _FLOW | {"feature": 4},
    "stylised-flow-extended": _FLOW | {"feature": 4},
    "stylised-flow-extended+style": _FLOW | _STYLE,
    "moglow": _FLOW | {"controls": ("hand_height", "hand_radius")},
    "mix-stage": _MIX,
    "mix-stage-extended": _MIX,
    "mix-stage-extended+played": _MIX
    | {"adversarial_loss": "squares", "pose_discriminator": True, "persistence": 6.0, "reconstruction": 0.5}
    | {"motion_statistics": 1.0, "speed_distribution": 1.0, "part_correlation": 1.0, "part_timing": 1.0},
    "mix-stage+authors": _MIX | {"soft": True, "adversarial_loss": "distance", "growth": 0.1, "id_freezes": True},
    "mix-stage+before": _MIX | {"style_first": True},
    "stage": _MIX,
    "cmix-gan": _MIX,
    "speaker-classifier+plain": {"plain": True},
    "chain-of-generation": _CHAIN | {"gesture_features": 6},
    "chain-of-generation-extended": _CHAIN,
    "chain-of-generation-extended+played": _CHAIN | _OBJECTIVES_OF_PLAY,
    "chain-of-generation-live": _CHAIN | {"look_ahead": 3, "pooling_window": 5},
    "chain-of-generation-live+played": _CHAIN | _OBJECTIVES_OF_PLAY | {"look_ahead": 2, "pooling_window": 5},
    "speech-classifier": {"frames": 10},
    "seq2seq": {"frames": 10},
    "joint-embedding": {"frames": 12},
    "speech2affective-gestures": {"frames": 12, "speaker": 3},
    "trimodal": {"frames": 12, "speaker": 3},
    "trimodal+regression": {"frames": 12, "speaker": 3, "adversarial": 0.0, "diversity": 0.0, "seed_dropout": 0.5},
    "camn": _MANY,
    "camn+alone": _MANY | {"semantic": False, "seed_dropout": 0.5},
    "multi-context": _CONTEXT,
    "multi-context+all": _CONTEXT | {"emotion": 2, "face": 4, "adversarial_from": 0, "slope": 0.2},
    "multi-context+regression": _CONTEXT | {"adversarial": 0.0, "diversity": 0.0, "divergence": 0.0, "seed_dropout": 0.5},
    "speech2gesture": {"frames": 20, "depth": 2, "decoder": 1},
    "speech2gesture+seeded": {"frames": 20, "depth": 2, "decoder": 1, "seed": 3, "regression": 100.0},
}
"""What differs from the network's own tiny configuration."""


def network_class(name: str):
    module, _, attribute = ENTRIES[name.partition("+")[0]].where.partition(":")
    return getattr(import_module(module), attribute)


TRAINABLE = sorted(name for name in ENTRIES if hasattr(network_class(name), "objectives"))
NAMES = [*TRAINABLE, *(name for name in CHANGES if "+" in name)]


def sizes(kind, pose: int = POSE, audio: int = AUDIO) -> dict[str, int | list[int]]:
    """The sizes that a network is built with."""
    values = {"pose": pose, "audio": audio, "speakers": 1 if kind.__name__ == "CMixGan" else ROWS}
    values |= {"hands": [1, pose - 1], "text": 0}
    return {key: size for key, size in values.items() if key in signature(kind.__init__).parameters}


def tiny(name: str, **changes):
    """The configuration of a small network."""
    return network_class(name).Config.tiny(**(CHANGES.get(name, {}) | changes))


def network(name: str, seed: int = 0, pose: int = POSE, audio: int = AUDIO, **changes):
    """A small network, its zeros moved a little so that no gradient is zero for that reason alone."""
    torch.manual_seed(seed)
    kind = network_class(name)
    net = kind(tiny(name, **changes), **sizes(kind, pose, audio))
    with torch.no_grad():
        for value in net.parameters():
            if not value.any():
                value.normal_(0, 0.05)
    return net


def batch(net, seed: int = 0, step: int = 0, rows: int = ROWS) -> Batch:
    """A batch of random walks, not of noise, so that there is something to learn."""
    draw = torch.Generator().manual_seed(seed)
    widths = {"pose": getattr(net, "pose", 0), "audio": AUDIO, "control": 3}
    arrays = {
        name: torch.randn(rows, net.window, widths.get(name, 1), generator=draw).cumsum(1) / net.window**0.5
        for name in net.arrays
    }
    shape = (rows, net.window)
    labels = {
        "text": lambda: torch.randint(BUCKETS + 1, (*shape, GRAMS), generator=draw),
        "face": lambda: torch.rand(*shape, 52, generator=draw),
        "emotion": lambda: torch.randint(-1, 8, (rows, 1), generator=draw).repeat(1, net.window),
        "semantic": lambda: torch.rand(*shape, generator=draw),
    }
    arrays |= {name: make() for name, make in labels.items() if name in net.arrays}
    if "cluster" in arrays:
        arrays["cluster"] = torch.randint(net.config.modes, (rows, net.window), generator=draw)
    arrays["speaker"] = torch.arange(rows) % ROWS
    return Batch(arrays, StepRandom(seed, step))


def part(whole: Batch, row: int, step: int = 0) -> Batch:
    """One row of a batch, as one of several processes has it."""
    return Batch({k: v[row : row + 1] for k, v in whole.arrays.items()}, StepRandom(0, step, rank=row, parts=len(whole)))


def total(net, data: Batch, step: int = 0):
    return sum(sum(objective.loss(data, step).values()) for objective in net.objectives().values())


def make_ready(name: str, **options):
    """A network that has seen a batch (which sets ActNorm), in evaluation mode."""
    net = network(name, **options).train()
    with torch.no_grad(), plain_convolutions():
        total(net, batch(net))
    return net.eval()


def make_once(make):
    """Make each network once. Every test gets a copy, and the random state that followed its making."""
    build = cache(lambda name, **options: (make(name, **options), torch.get_rng_state()))

    @wraps(make)
    def copy(name: str, **options):
        net, chance = build(name, **options)
        torch.set_rng_state(chance)
        return deepcopy(net)

    return copy


ready = make_once(make_ready)


def test_every_registered_network_is_tested():
    assert {name for name in TRAINABLE if not network_class(name).Config.TINY} == set()
    assert {name.partition("+")[0] for name in CHANGES} <= set(TRAINABLE) == set(NETWORKS)


@pytest.mark.parametrize("name", TRAINABLE)
def test_the_registry_says_what_a_network_needs(name):
    """The arrays beside poses and sound. A variant of the configuration may need fewer or more."""
    names = {"text": "words", "face": "face", "emotion": "emotion"}
    assert {names[array] for array in network(name).arrays if array in names} == set(ENTRIES[name].needs)


@pytest.mark.parametrize("name", NAMES)
def test_losses_are_finite_numbers_and_leave_the_batch_alone(name):
    net = network(name)
    data = batch(net)
    before = {key: value.clone() for key, value in data.arrays.items()}
    for objective in net.objectives().values():
        for term in objective.loss(data, 0).values():
            assert term.shape == ()
            assert term.isfinite()
    assert all(torch.equal(before[key], data[key]) for key in before)


@pytest.mark.parametrize("name", NAMES)
def test_gradient_reaches_every_parameter(name):
    net = ready(name)
    parameters = {id(value) for objective in net.objectives().values() for value in objective.parameters}
    assert parameters == {id(value) for value in net.parameters()}
    total(net, batch(net)).backward()
    still = [key for key, value in net.named_parameters() if value.grad is None or not value.grad.abs().max() > 0]
    assert still == []
    assert all(value.grad.isfinite().all() for value in net.parameters())


@pytest.mark.parametrize("name", NAMES)
def test_the_same_seed_gives_the_same(name):
    first, again, other = (make_ready(name, seed=seed) for seed in (0, 0, 1))
    data = batch(first)
    losses = [total(net, Batch(data.arrays, StepRandom(0, 0))).item() for net in (first, again, other)]
    assert losses[0] == losses[1]
    assert losses[0] != losses[2]


@pytest.mark.parametrize("name", NAMES)
def test_rows_are_independent_of_each_other(name):
    net = ready(name)
    data = batch(net)

    def apart(batch: Batch):
        """Without what sets a row's poses against the speech of another row on purpose (models/nn/pose_discriminator.py)."""
        terms = [objective.loss(batch, 0) for objective in net.objectives().values()]
        return sum(value for each in terms for name, value in each.items() if name != "mismatched")

    with torch.no_grad():
        whole = apart(data)
        single = [apart(part(data, row)) for row in range(ROWS)]
    assert torch.allclose(whole, torch.stack(single).mean(), rtol=1e-5, atol=1e-6)
    assert len({round(value.item(), 4) for value in single}) == ROWS


@pytest.mark.parametrize("name", NAMES)
def test_saved_and_loaded_it_is_the_same_to_the_bit(name, tmp_path):
    net, other = ready(name), network(name, seed=1).eval()
    save_file({key: value.contiguous() for key, value in net.state_dict().items()}, tmp_path / "net.safetensors")
    other.load_state_dict(load_file(tmp_path / "net.safetensors"))
    data = batch(net)
    assert torch.equal(*(total(one, Batch(data.arrays, StepRandom(0, 0))) for one in (net, other)))


LEARN_LATE = {"cmix-gan", "mix-stage", "mix-stage-extended", "mix-stage+before", "fgd-autoencoder", "speaker-classifier"}
"""Networks whose loss is not 5 % lower after ten steps at twice the rate: they take twenty."""
LEARN_LATE |= {"speech-to-face"}  # which needs more than three rows


@pytest.mark.parametrize("name", NAMES)
def test_some_steps_lower_the_loss(name):
    steps, rate, rows = (20, 3e-3, 6) if name in LEARN_LATE else (10, 6e-3, 3)
    net = ready(name)
    data = batch(net, rows=rows)
    optimisers = {
        key: torch.optim.Adam(objective.parameters, rate)
        for key, objective in ((key, o._replace(parameters=list(o.parameters))) for key, o in net.objectives().items())
    }

    def now() -> float:
        with torch.no_grad():
            return total(net.eval(), Batch(data.arrays, StepRandom(0, 0))).item()

    before = now()
    for step in range(steps):
        net.train()
        for key, objective in net.objectives().items():
            optimisers[key].zero_grad()
            sum(objective.loss(Batch(data.arrays, StepRandom(0, step)), step).values()).backward()
            optimisers[key].step()
    assert now() < before - 0.02 * abs(before)


@pytest.mark.parametrize("name", NAMES)
def test_sizes_that_are_none_are_told(name):
    kind = network_class(name)
    with pytest.raises(InputError):
        kind(replace(tiny(name), frames=0), **sizes(kind))


@pytest.mark.parametrize("name", TRAINABLE)
def test_a_size_that_is_none_is_told_by_its_name(name):
    wide = [size for size in ("hidden", "channels", "width", "layers") if hasattr(tiny(name), size)]
    assert wide
    for size in wide:
        with pytest.raises(InputError, match=rf"^{size} of .*is -3 \(\d+ at least\)$") as error:
            network(name, **{size: -3})
        assert len(str(error.value)) < 100


@pytest.mark.parametrize(
    ("name", "config", "pose", "audio", "count"),
    [
        # Yoon et al. 2020, authors' code: 190,691, of which 32·32 + 32 are of a layer without use (fc_logvar)
        ("fgd-autoencoder", {}, 27, 0, 190_691 - 1_056),
        # Liu et al. 2022 (BEAT): 10,095,499 by hand of the widths, of which 300·300 + 300 are of the same layer
        ("fgd-autoencoder", {"channels": 300, "hidden": 1200, "code": 300, "widening": 2}, 141, 0, 10_095_499 - 90_300),
        # Ye et al. 2022, authors' code at 27 and 69 numbers a pose
        ("stylised-flow", {}, 27, 29, 123_611_408),
        ("stylised-flow", {"history": 10, "look_ahead": 10, "frames": 100}, 69, 27, 146_478_480),
        # Alexanderson et al. 2020, authors' code on the upper body: "preferred" and as in the paper
        ("moglow", {"hidden": 512}, 45, 27, 82_004_080),
        ("moglow", {}, 45, 27, 172_330_096),
        # Ginosar et al. 2019 in one dimension, authors' code of Mix-StAGE: generator and discriminator
        ("speech2gesture", {}, 96, 64, 7_422_752 + 190_657),
        # the same with known poses, Yoon et al. 2020: our last convolution of speech covers eight bands, theirs three
        ("speech2gesture", {"seed": 16}, 27, 64, 6_438_347 + 5 * 3 * 256 * 256 + 172_993),
    ],
    ids=lambda value: str(value) if isinstance(value, int | str) else "",
)
def test_parameters_at_paper_size(name, config, pose, audio, count):
    kind = network_class(name)
    with torch.device("meta"):
        net = kind(kind.Config(**config), pose=pose, audio=audio)
    assert sum(value.numel() for value in net.parameters()) == count


def list_windowed() -> list[str]:
    return [name for name in NAMES if issubclass(network_class(name), Windowed)]


def speech(net, rows: int, frames: int, seed: int = 3):
    return torch.randn(rows, frames, net.audio, generator=torch.Generator().manual_seed(seed)).cumsum(1) / 8


def styles(net, *shape: int, seed: int = 4):
    return torch.randn(*shape, net.styles, generator=torch.Generator().manual_seed(seed)).softmax(-1)


@make_once
def train_windowed(name: str):
    """A network whose normalisation has the statistics of its data, so that its output varies with its input."""
    net = network(name).train()
    for part in net.modules():
        if isinstance(part, torch.nn.BatchNorm1d):
            part.momentum = None  # a plain average
    with torch.no_grad(), plain_convolutions():
        for seed in range(3):
            total(net, batch(net, seed))
    return net.eval()


def test_the_networks_that_make_windows_are_these():
    names = {"cmix-gan", "mix-stage", "munit", "speech2gesture", "stage", "camn", "multi-context"}
    names |= {"chain-of-generation", "chain-of-generation-live", "speech-to-face"}
    names |= {"chain-of-generation-extended", "mix-stage-extended", "audio2gestures", "talkshow", "gesturediffuclip"}
    names |= {"trimodal", "joint-embedding", "seq2seq", "speech2affective-gestures"}
    assert {name.partition("+")[0] for name in list_windowed()} == names
    for name in list_windowed():
        net = network(name)
        assert net.window % net.multiple == net.shortest % net.multiple == 0 or name.startswith("speech2gesture")
        if isinstance(net, SeededWindows):
            continue
        if isinstance(net, ManyInputs | ChainOfGeneration):
            noise = {"camn": lambda c: 0, "chain-of-generation": lambda c: 0, "multi-context": lambda c: c.speaker}.get(
                name.partition("+")[0], lambda c: c.noise
            )
            assert (net.styles, net.modes) == (ROWS + 8, noise(net.config))
            continue
        assert (net.styles > 0) is (net.encodes_style or net.literal)
        if isinstance(net, Sampled):
            assert net.modes > 0
            continue
        assert name == "audio2gestures" or net.modes == (
            net.config.modes if getattr(net, "mode_logits", None) is not None else 0
        )


@pytest.mark.parametrize("name", list_windowed())
def test_of_whole_multiples_what_is_generated_is_what_is_made(name):
    net = train_windowed(name)
    for frames in (net.shortest, 3 * net.shortest, net.shortest + net.multiple):
        audio, style = speech(net, ROWS, frames), styles(net, ROWS, 1)
        with torch.no_grad():
            poses = net.make(audio, style.expand(-1, frames, -1), torch.zeros(ROWS, frames, net.modes))
        assert poses.shape == (ROWS, frames, POSE)
        for same in (style, style.expand(-1, frames, -1)):  # PyTorch's last bit is not the same twice on every processor
            torch.testing.assert_close(net.generate(audio, same), poses, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", list_windowed())
def test_speech_of_any_length_is_filled_up_with_its_last_frame(name):
    net = train_windowed(name)
    for frames in (1, 2, max(1, net.shortest - 1), net.shortest + 1, 2 * net.multiple + 3, 131):
        audio, style = speech(net, ROWS, frames), styles(net, ROWS, frames)
        whole = max(net.shortest, -(-frames // net.multiple) * net.multiple)
        longer = [torch.cat([x, x[:, -1:].repeat(1, whole - frames, 1)], 1) for x in (audio, style)]
        poses = net.generate(audio, style)
        assert poses.shape == (ROWS, frames, POSE)
        assert poses.isfinite().all()
        torch.testing.assert_close(poses, net.generate(*longer)[:, :frames], rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", list_windowed())
def test_rows_of_speech_are_made_apart(name):
    net = train_windowed(name)
    audio, style = speech(net, ROWS, 70), styles(net, ROWS, 1)
    poses = net.generate(audio, style)
    alone = torch.cat([net.generate(audio[k : k + 1], style[k : k + 1]) for k in range(ROWS)])
    assert torch.allclose(poses, alone, atol=1e-5)
    other = audio.clone()
    other[1] = other[1].flip(0)
    change = (net.generate(other, style) - poses).abs().amax((1, 2))
    assert change[1] > 1e-3
    assert change[[0, 2]].max() < 1e-6


@pytest.mark.parametrize("name", [name for name in list_windowed() if network(name).styles])
def test_styles_and_mixtures_of_them_differ(name):
    net = train_windowed(name)
    audio, (one, other) = speech(net, 1, 64), torch.eye(net.styles)[:2]
    first, second, half = (net.generate(audio, style.view(1, 1, -1)) for style in (one, other, (one + other) / 2))
    gap = (first - second).abs().mean()
    assert gap > 1e-3
    farthest = gap * (2 if vars(net.config).get("style_first") else 1)  # through a whole U-Net a mixture is no mean
    for end in (first, second):
        assert 1e-4 < (half - end).abs().mean() < farthest
    assert torch.equal(net.generate(audio, one.view(1, 1, -1)), first)


@pytest.mark.parametrize("name", list_windowed())
def test_every_speaker_has_a_style_that_can_be_fed(name):
    net = train_windowed(name)
    speakers = ROWS if name != "cmix-gan" else 1
    stretches = torch.randn(speakers, 4, 128, POSE, generator=torch.Generator().manual_seed(5)).cumsum(2) / 8
    codes = net.speaker_styles(stretches)
    assert codes.shape == (speakers, net.styles)
    if net.encodes_style:
        assert net.style_of(stretches[:, 0, :64]).shape == (speakers, net.styles)
        assert len({tuple(row.tolist()) for row in codes}) == speakers
    assert net.generate(speech(net, speakers, 40), codes.unsqueeze(1)).isfinite().all()


@pytest.mark.parametrize("name", list_windowed())
def test_mode_noise_moves_the_modes_and_only_them(name):
    net = train_windowed(name)
    frames = 64 // net.multiple * net.multiple
    audio, style = speech(net, 1, frames), styles(net, 1, frames)
    with torch.no_grad():
        poses = net.make(audio, style, torch.zeros(1, frames, net.modes))
        if not net.modes:
            assert poses.shape == (1, frames, POSE)
            return
        if isinstance(net, ManyInputs | ChainOfGeneration | SeededWindows | Audio2Gestures | Sampled):
            # noise that it gets beside its inputs
            assert (net.make(audio, style, torch.ones(1, frames, net.modes)) - poses).abs().mean() > 1e-4
            return
        even = net.make(audio, style, torch.full((1, 64, net.modes), 7.0))
        assert torch.allclose(even, poses, atol=1e-5)  # a softmax does not feel what all have
        certain = [net.make(audio, style, 1e4 * torch.eye(net.modes)[m].expand(1, 64, -1)) for m in range(net.modes)]
        own = net.generators(net.latent(net.audio_content(audio), style))
    for m, alone in enumerate(certain):
        assert torch.allclose(alone, own[:, m].mT, atol=1e-6)
    assert (certain[0] - certain[1]).abs().mean() > 1e-3
    low, high = (torch.stack(certain).amin(0), torch.stack(certain).amax(0))
    assert ((poses >= low - 1e-5) & (poses <= high + 1e-5)).all()  # a weighted sum lies between them


@pytest.mark.parametrize("name", list_windowed())
def test_speech_and_styles_of_other_shapes_are_told(name):
    net = network(name).eval()
    audio, style = speech(net, 2, 40), styles(net, 2, 1)
    wrong = [(audio[:, :0], style), (audio[..., :-1], style), (audio, style[:1]), (audio, torch.zeros(2, 1, net.styles + 1))]
    for sound, code in [*wrong, (audio, style.expand(-1, 2, -1)), (audio, style[:, 0])]:
        with pytest.raises(InputError, match="speech of shape"):
            net.generate(sound, code)


def flows() -> list[str]:
    return [name for name in TRAINABLE if hasattr(network_class(name), "log_prob")]


def given(data: Batch) -> tuple:
    return tuple(data[name] for name in ("pose", "audio", "control") if name in data.arrays)


def train_flow(name: str, **options):
    """A flow far from the identity: all its parameters moved."""
    net = ready(name, **options)
    with torch.no_grad():
        for key, value in net.named_parameters():
            if "flow" in key:
                value.add_(torch.randn_like(value), alpha=0.02 if value.ndim > 1 else 0.1)
    return net


@pytest.mark.parametrize(
    ("name", "changes"),
    [*((name, {}) for name in flows()), *((name, {"residual": True}) for name in flows() if name != "stylised-flow")],
)
@pytest.mark.parametrize("nu", [50, 3])
def test_poses_are_what_their_latents_generate(name, nu, changes):
    net = train_flow(name, steps=16, pose=27, hidden=32, nu=nu, frames=12, **changes)
    data = batch(net)
    with torch.no_grad():
        z = net.latents(*given(data))
        history = net.config.history
        poses, *rest = given(data)
        sample = net.sample(z, poses[:, :history], *rest)
        again = net.latents(torch.cat([poses[:, :history], sample, poses[:, history + sample.shape[1] :]], 1), *rest)
    assert (z - poses[:, history : history + 12]).abs().mean() > 0.1
    assert (sample - poses[:, history : history + 12]).abs().max() <= 1e-4
    assert (again - z).abs().max() <= 1e-3


@pytest.mark.parametrize("name", flows())
@pytest.mark.parametrize("pose", [5, 6])
def test_the_log_determinant_is_that_of_the_jacobian(name, pose):
    net = train_flow(name, pose=pose).double()
    data = batch(net, rows=1)
    poses, *rest = (value.double() for value in given(data))
    history, frames = net.config.history, net.config.frames

    def latents(x):
        window = torch.cat([poses[0, :history], x.view(frames, pose), poses[0, history + frames :]])
        return net.latents(window[None], *rest).flatten()

    jacobian = torch.autograd.functional.jacobian(latents, poses[0, history : history + frames].flatten())
    sign, expected = torch.linalg.slogdet(jacobian)
    z = latents(poses[0, history : history + frames].flatten()).view(frames, pose)
    with torch.no_grad():
        got = (net.log_prob(poses, *rest)[0] - net.flow.latent.log_prob(z)).sum()
    assert sign.abs() == 1
    assert torch.allclose(got, expected, rtol=1e-7, atol=1e-7)
    later = jacobian.view(frames, pose, frames, pose)
    assert all(later[t, :, s].abs().max() == 0 for t in range(frames) for s in range(t + 1, frames))  # no pose sees the next


@pytest.mark.parametrize(("name", "nu"), [*((name, 4) for name in flows()), ("stylised-flow", 50), ("moglow", 0)])
@pytest.mark.parametrize("dimensions", [1, 2])
def test_the_density_integrates_to_one(name, nu, dimensions):
    net = train_flow(name, pose=dimensions, nu=nu, frames=1).double()
    data = batch(net, rows=1)
    axis = torch.linspace(-60, 60, 20_001 if dimensions == 1 else 301, dtype=torch.float64)
    grid = torch.cartesian_prod(*[axis] * dimensions).view(-1, 1, dimensions)
    poses, *rest = (value.double().expand(len(grid), -1, -1) for value in given(data))
    history = net.config.history
    with torch.no_grad():
        windows = torch.cat([poses[:, :history], grid, poses[:, history + 1 :]], 1)
        log_prob = torch.cat([net.log_prob(*part) for part in zip(*(v.split(20_000) for v in (windows, *rest)), strict=True)])
    assert log_prob.shape == (len(grid), 1)
    assert abs(log_prob.exp().sum().item() * (axis[1] - axis[0]).item() ** dimensions - 1) < 0.01


@pytest.mark.parametrize("name", flows())
def test_frame_by_frame_is_all_at_once(name):
    net = train_flow(name)
    data = batch(net)
    poses, *rest = given(data)
    z = torch.randn(ROWS, net.config.frames, POSE, generator=torch.Generator().manual_seed(5))
    whole = net.sample(z, poses[:, : net.config.history], *rest)
    alone = torch.cat([net.sample(z[row : row + 1], poses[row : row + 1, : net.config.history],
                                  *(v[row : row + 1] for v in rest)) for row in range(ROWS)])  # fmt: skip
    assert whole.isfinite().all()
    assert torch.allclose(whole, alone, atol=1e-5)
    cut = [v[:, : -net.config.look_ahead - 1].clone() for v in rest]
    cut = [torch.cat([c, torch.zeros_like(v[:, c.shape[1] :])], 1) for c, v in zip(cut, rest, strict=True)]
    other = net.sample(z, poses[:, : net.config.history], *cut)
    assert not torch.equal(other[:, -1], whole[:, -1])
    assert torch.equal(*(one[:, : net.config.frames - net.config.look_ahead - 1] for one in (other, whole)))


def test_moglow_needs_the_controls_that_it_was_trained_with_and_they_move_it():
    net = train_flow("moglow")
    data = batch(net)
    poses, audio, control = given(data)
    with pytest.raises(InputError, match="hand_height, hand_radius"):
        net.log_prob(poses, audio)
    z, history = torch.zeros(ROWS, net.config.frames, POSE), poses[:, : net.config.history]
    first = net.sample(z, history, audio, control)
    height, speed = control.clone(), control.clone()
    height[..., 0] += 1
    speed[..., 1] += 1  # not one of its own
    assert (net.sample(z, history, audio, height) - first).abs().max() > 1e-3
    assert torch.equal(net.sample(z, history, audio, speed), first)
    kind = network_class("moglow")
    for wrong in (("hand_heights",), ("hand_height", "hand_height")):
        with pytest.raises(InputError, match="style controls"):
            kind(kind.Config(**_FLOW, controls=wrong), pose=POSE, audio=AUDIO)
