"""Speech as other voices would have it: what changes, what stays, and who hears it."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.nn.objective import StepRandom  # noqa: E402
from cospeech.models.nn.speech_augmentation import SpeechAugmentation  # noqa: E402
from tests.models import test_chain_of_generation as chains  # noqa: E402
from tests.models import test_mix_stage as mixes  # noqa: E402

torch.set_num_threads(1)
AMOUNT = 0.6


def sounds(rows: int = 256, frames: int = 64, count: int = 5):
    """(rows, frames, count) syllables, some four a second, of which each number has a level of its own."""
    at, axis = torch.arange(frames)[None, :, None], torch.arange(count)
    return (1 + torch.sin(at / 2 + torch.arange(rows)[:, None, None])).expand(-1, -1, count) + axis


def augment(audio, amount: float = AMOUNT, step: int = 0):
    return SpeechAugmentation(amount).train()(audio, StepRandom(0, step))


def test_nothing_changes_outside_of_training_or_without_an_amount():
    audio = sounds(4)
    assert torch.equal(SpeechAugmentation(AMOUNT).eval()(audio, StepRandom(0, 0)), audio)
    assert torch.equal(augment(audio, 0.0), audio)


def test_levels_and_ranges_change_from_window_to_window_by_what_is_said():
    audio = sounds()
    shift = (augment(audio) - audio).mean(1)
    assert shift.std(0) == pytest.approx([AMOUNT] * 5, rel=0.2)
    assert abs(torch.corrcoef(shift.T)[0, 1]) < 0.2  # each number on its own
    ratio = (augment(audio).std(1) / audio.std(1)).log()
    assert 0.15 < ratio.std().item() < 0.4
    assert not torch.equal(augment(audio), augment(audio, step=1))


def test_when_the_speech_is_loud_stays():
    audio = sounds()
    a, b = (x - x.mean(1, keepdim=True) for x in (audio, augment(audio)))
    r = (a * b).sum(1) / (a.norm(dim=1) * b.norm(dim=1))
    assert r.median() > 0.9
    assert r.min() > 0.5


@pytest.mark.parametrize("make", [mixes.make_extended, chains.chain, chains.live])
def test_an_amount_below_zero_is_refused(make):
    with pytest.raises(InputError, match="speech_augmentation"):
        make(speech_augmentation=-0.1)


def test_mix_stage_hears_it_and_its_discriminator_does_not():
    net = mixes.make_extended(pose_discriminator=True, speech_augmentation=AMOUNT).train()
    batch, to_encoder, to_discriminator = mixes.batch(), [], []
    net.audio_content.register_forward_pre_hook(lambda part, given: to_encoder.append(given[0]))
    net.discriminator.register_forward_pre_hook(lambda part, given: to_discriminator.append(given[1]))
    net.discriminator_loss(batch, 0)
    assert not torch.equal(to_encoder[0], batch["audio"])
    assert to_discriminator
    assert all(torch.equal(x.mT.sort(0).values, batch["audio"].sort(0).values) for x in to_discriminator)
    net.eval()
    net.discriminator_loss(batch, 0)
    assert torch.equal(to_encoder[-1], batch["audio"])


@pytest.mark.parametrize("make", [chains.chain, chains.live])
def test_the_decoders_of_a_chain_hear_it_and_its_classifier_does_not(make):
    net = make(adversarial=1.0, discriminator_channels=4, speech_augmentation=AMOUNT).train()
    batch, to_encoder, to_classifier = chains.batch(net), [], []
    net.speech_encoder.register_forward_pre_hook(lambda part, given: to_encoder.append(given[0]))
    net.classifier.register_forward_pre_hook(lambda part, given: to_classifier.append(given[0]))
    turn = net._turn(batch)
    assert torch.equal(turn.inputs["audio"], batch["audio"])
    assert to_encoder
    assert to_classifier
    assert not any(torch.equal(x.mT[:, : batch["audio"].shape[1]], batch["audio"]) for x in to_encoder)
    assert all(torch.equal(x, batch["audio"]) for x in to_classifier)
