"""How the parts of a body share out their speed: what the two distances see, and what they do not."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.models.nn.part_speeds import (  # noqa: E402
    PartWeights,
    correlation_distance,
    distribution_distance,
    part_terms,
    part_timing_distance,
)
from cospeech.motion.poses import find_pose  # noqa: E402
from cospeech.motion.poses.joints import part_columns  # noqa: E402
from tests.models.test_chain_of_generation import batch, chain  # noqa: E402

torch.set_num_threads(1)
TWO = [[0, 1], [2, 3]]


def strokes(shift: float, size: float = 1.0, rests: bool = True):
    """(2, 2, 64) at 15 a second: a quick stroke every 1.2 s, and rest between; or the same path at an even speed."""
    phase = (torch.arange(64) / 15 - shift) / 1.2
    whole = torch.floor(phase)
    path = whole + torch.sigmoid(24 * (phase - whole - 0.5)) if rests else phase
    return size * path.expand(2, 2, -1)


def test_a_distribution_knows_rests_and_sizes_and_not_when():
    recording = torch.cat([strokes(0.0), strokes(0.3)], 1)
    later, even, small = (
        torch.cat([other, strokes(0.3)], 1) for other in (strokes(0.6), strokes(0.0, rests=False), strokes(0.0, 0.5))
    )
    assert distribution_distance(recording, recording, TWO) == 0
    same, flat, less = (distribution_distance(other, recording, TWO).item() for other in (later, even, small))
    assert same < 0.1 < 0.4 < flat
    assert less > 0.1


def test_timing_is_that_of_each_part_and_not_of_the_whole():
    recording = torch.cat([strokes(0.0), strokes(0.6)], 1)
    other_way = torch.cat([strokes(0.6), strokes(0.0)], 1)
    assert part_timing_distance(0.5 * recording, recording, TWO).item() < 0.1
    assert part_timing_distance(other_way, recording, TWO).item() > 1
    assert part_timing_distance(other_way, recording, [range(4)]).item() < 0.1


def test_correlation_knows_which_parts_move_together_and_not_when():
    recording = torch.cat([strokes(0.0), strokes(0.6)], 1)
    later, together = torch.cat([strokes(0.3), strokes(0.9)], 1), torch.cat([strokes(0.0), 2 * strokes(0.0)], 1)
    assert correlation_distance(recording, recording, TWO) == 0
    assert correlation_distance(later, recording, TWO).item() < 0.2
    assert correlation_distance(together, recording, TWO).item() > 1
    assert correlation_distance(together, recording, [range(4)]) == 0


def test_of_weight_0_there_is_no_term():
    recording, other = strokes(0.0), strokes(0.3)
    assert part_terms(PartWeights(), other, recording, [[0, 1]]) == {}
    terms = part_terms(PartWeights(2.0, 0.0, 3.0), other, recording, [[0, 1]])
    assert terms.keys() == {"speed_distribution", "part_timing"}
    assert terms["speed_distribution"] == 2 * distribution_distance(other, recording, [[0, 1]])
    assert terms["part_timing"] == 3 * part_timing_distance(other, recording, [[0, 1]])


def test_parts_of_a_body_are_all_columns_each_once_and_no_part_has_both_sides():
    for name, parts in {"expmap-humanoid": 6, "keypoints2d": 4, "euler": 6, "direction-vectors": 4, "expmap-full": 8}.items():
        names = find_pose(name).names
        groups = part_columns(names)
        assert len(groups) == parts
        assert sorted(column for part in groups for column in part) == [*range(len(names))]
        for part in groups:
            sides = {names[column][0].lower() for column in part if names[column][:1] in "lrLR"}
            assert len(sides) <= 1


def test_the_chain_learns_from_all_three():
    net, plain = chain(speed_distribution=1.0, part_correlation=1.0, part_timing=1.0).train(), chain().train()
    net.parts = [[0, 1], [2, 3]]
    assert net.dimensions_for(net.config) == (*plain.dimensions_for(plain.config), "parts")
    terms, before = (each.gesture_loss(batch(each), 0) for each in (net, plain))
    assert terms.keys() - before.keys() == {*PartWeights._fields}
    for name in PartWeights._fields:
        gradients = torch.autograd.grad(
            terms[name], net.objectives()["gestures"].parameters, allow_unused=True, retain_graph=True
        )
        assert any(each is not None and each.abs().max() > 0 for each in gradients)
