"""Every network of a table hears: after some seconds on a toy corpus, own speech beats another's."""

from __future__ import annotations

from typing import Any

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from tests.models.test_contract import batch, network  # noqa: E402
from tests.support.hears import measure_hearing  # noqa: E402

torch.set_num_threads(1)

CASES: dict[str, dict[str, Any]] = {
    "multi-context": {"term": "generator.huber", "steps": 80},
    "gesticulator": {"term": "gestures.pose"},
    "gesticulator, words": {"term": "gestures.pose"},
    "audio2gestures": {"term": "gestures.relaxed_position", "steps": 120, "lr": 1e-2},
    "talkshow": {"term": "prior.body", "steps": 120, "rows": 16},
    "gesturediffuclip": {"term": "diffusion.velocity", "steps": 200},
    "trimodal": {"term": "generator.huber", "steps": 60, "lr": 1e-2},
    "joint-embedding": {"term": "speech_l1", "steps": 200, "lr": 1e-2, "rows": 16},
    "speech2affective-gestures": {"term": "generator.huber", "steps": 80, "lr": 1e-2},
    "speech2gesture+seeded": {"term": "generator.l1", "steps": 120, "lr": 1e-2},
    "seq2seq, words": {"term": "gestures.regression", "steps": 60, "lr": 1e-2},
}
"""Network → what `measure_hearing` is told; ``NETWORK, words``: motion follows the words."""
AT_MOST, ENOUGH = 0.8, 0.75
"""Shares of another speech's loss: what own speech may have, and with which the training ends early. [ours]"""


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_own_speech_beats_anothers(case):
    name, _, words = case.partition(", ")
    hearing = measure_hearing(network(name), batch, follows="text" if words else "audio", enough=ENOUGH, **CASES[case])
    assert hearing.own < AT_MOST * hearing.other
