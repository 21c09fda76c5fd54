"""Whether a network hears: trained for some seconds on a toy corpus, does own speech beat another's?

In the toy corpus motion follows the sound, or the words, and nothing else. After training, the loss of held-out windows with
their own speech is compared with their loss with the speech of another window. The two are equal for a network that does not
hear.

>>> hearing = measure_hearing(net, batch, term="generator.huber")     # doctest: +SKIP
>>> assert hearing.own < 0.8 * hearing.other                           # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor

from cospeech.audio.features.words import BUCKETS, GRAMS
from cospeech.models.nn.objective import Batch, StepRandom

__all__ = ["Hearing", "follow_speech", "measure_hearing"]

WORDS, HOLD = 6, 5  # of the toy language: so many words, each held for so many frames
LOOK = 20  # steps of training from one look at what the network hears to the next
HELD_OUT = 1_000_000  # seed of the windows that are not trained on

MakeBatch = Callable[..., Batch]
"""(net, seed=, rows=) → a batch with all arrays of the network, such as `tests.models.test_contract.batch`."""


class Hearing(NamedTuple):
    """A term of the loss of held-out windows."""

    own: float
    """With the speech that the motion follows."""
    other: float
    """With the speech of another window."""


def follow_speech(data: Batch, follows: str, seed: int) -> dict[str, Tensor]:
    """The arrays of a batch, with poses that follow its speech.

    Args:
        data: of any network; its poses are replaced.
        follows: ``audio``: poses are a linear map of the rows of speech; ``text``: every word has a pose, which is held.
        seed: of the words.
    """
    arrays = dict(data.arrays)
    rows, frames, width = arrays["pose"].shape
    draw = torch.Generator().manual_seed(seed)
    if "text" in arrays:
        language = torch.randint(1, BUCKETS + 1, (WORDS, GRAMS), generator=torch.Generator().manual_seed(7))
        spoken = torch.randint(WORDS, (rows, -(-frames // HOLD)), generator=draw).repeat_interleave(HOLD, 1)[:, :frames]
        arrays["text"] = language[spoken]
    source = torch.nn.functional.one_hot(spoken, WORDS).float() if follows == "text" else arrays["audio"]
    towards = torch.randn(source.shape[-1], width, generator=torch.Generator().manual_seed(8))
    poses = source @ towards
    arrays["pose"] = (poses - poses.mean((0, 1))) / poses.std((0, 1))
    return arrays


def measure_hearing(
    net: Any, make_batch: MakeBatch, *, term: str, follows: str = "audio", swaps: Sequence[str] = ("audio", "text"),
    steps: int = 150, lr: float = 5e-3, rows: int = 8, first_step: int = 0, enough: float = 0.0,
) -> Hearing:  # fmt: skip
    """Train a network on the toy corpus and compare own speech with another's.

    Args:
        net: a small network, as it is initialised; it is trained here.
        make_batch: see `MakeBatch`.
        term: ``OBJECTIVE.TERM`` of its losses that is compared, one that says how near poses are.
        follows: see `follow_speech`.
        swaps: arrays that another window's are put in the place of.
        steps, lr, rows: of training, by Adam; every step has new windows.
        first_step: number of the first step, for a loss that changes with it.
        enough: share of another speech's loss that ends the training; it is looked at every `LOOK` steps.
    """
    objectives = {name: o._replace(parameters=[*o.parameters]) for name, o in net.objectives().items()}
    optimisers = {name: torch.optim.Adam(o.parameters, lr) for name, o in objectives.items()}
    arrays = follow_speech(make_batch(net, seed=HELD_OUT, rows=2 * rows), follows, HELD_OUT)
    others = arrays | {name: arrays[name].roll(1, 0) for name in swaps if name in arrays}
    which, _, part = term.partition(".")

    def look() -> Hearing:
        net.eval()
        with torch.no_grad():
            pair = [Batch(some, StepRandom(0, 0)) for some in (arrays, others)]
            last = first_step + steps
            own, other = [objectives[which].loss(one, last)[part] if part else net.validate(one)[which] for one in pair]
        net.train()
        return Hearing(own.item(), other.item())

    net.train()
    for step in range(first_step, first_step + steps):
        if (step - first_step) % LOOK == LOOK - 1 and (hearing := look()).own < enough * hearing.other:
            return hearing
        data = follow_speech(make_batch(net, seed=step, rows=rows), follows, step)
        for name, objective in objectives.items():
            if objective.is_active_at(step):
                optimisers[name].zero_grad()
                sum(objective.loss(Batch(data, StepRandom(0, step)), step).values()).backward()
                optimisers[name].step()
    return look()
