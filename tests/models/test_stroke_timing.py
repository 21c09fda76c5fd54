"""The term of stroke timing in the networks that play with one rate for speech and pose."""

from __future__ import annotations

from dataclasses import replace

import pytest

torch = pytest.importorskip("torch")

from .test_contract import NAMES, batch, network, tiny  # noqa: E402

WITH_TIMING = [
    name for name in NAMES if "stroke_timing" in vars(tiny(name)) and not name.startswith("stylised-flow")
]  # a test of its own


def terms(net, data) -> dict[str, torch.Tensor]:
    """The terms of the loss of the last objective, which makes gestures."""
    torch.manual_seed(0)  # of dropout
    return [*net.objectives().values()][-1].loss(data, 0)


def test_these_networks_have_it():
    assert {name.partition("+")[0] for name in WITH_TIMING} == {
        "camn", "chain-of-generation-extended", "chain-of-generation-live", "mix-stage-extended", "moglow", "multi-context",
        "seq2seq", "speech2affective-gestures", "speech2gesture", "trimodal",
    }  # fmt: skip


@pytest.mark.parametrize("name", WITH_TIMING)
def test_it_is_one_term_more_and_says_when_strokes_come(name):
    frames = max(24, tiny(name).frames)
    plain, with_weight = (network(name, frames=frames, stroke_timing=weight) for weight in (0.0, 2.0))
    without, with_it = (terms(net, batch(plain)) for net in (plain, with_weight))
    assert with_it.keys() - without.keys() == {"stroke_timing"}
    for key, value in without.items():
        torch.testing.assert_close(with_it[key], value)
    assert 0 < with_it["stroke_timing"].item() <= 4  # 2 (1 − r)
    parameters = [p for p in with_weight.parameters() if p.requires_grad]
    slopes = torch.autograd.grad(with_it["stroke_timing"], parameters, allow_unused=True)
    assert any(slope is not None and slope.abs().max() > 0 for slope in slopes)


@pytest.mark.parametrize("name", [name for name in WITH_TIMING if "+" not in name])
def test_a_negative_weight_is_told(name):
    from cospeech import InputError

    with pytest.raises(InputError, match="stroke_timing"):
        replace(tiny(name), stroke_timing=-1.0)
