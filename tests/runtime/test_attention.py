"""At whom somebody looks in a group."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from cospeech.audio.conversation import HeardSpeaker, VoiceTrack
from cospeech.audio.prosodic_events import Phrase
from cospeech.runtime.attention import Attention, AttentionShift, find_row, find_seats, plan_attention

SHIFTS = [AttentionShift(0.0, 30.0), AttentionShift(2.0, -30.0), AttentionShift(5.0, 45.0)]


def person(*phrases):
    return HeardSpeaker(VoiceTrack("x.wav"), np.ones(1), Fraction(60), tuple(Phrase(*each) for each in phrases))


def test_eyes_go_first_and_the_head_follows_below_its_speed():
    times = np.arange(0, 8, 1 / 120)
    eyes, head = (np.degrees(each) for each in Attention(SHIFTS).find_angles(times))
    for time, before, after in ((2.0, 30, -30), (5.0, -30, 45)):
        at = round(time * 120)
        assert eyes[at] == pytest.approx(before)
        assert eyes[at + 12] == pytest.approx(after)
        assert abs(head[at + 12] - before) < 0.3 * abs(after - before)
        assert head[at + 130] == pytest.approx(after)
    assert np.abs(np.gradient(head) * 120).max() < 150


@pytest.mark.parametrize("size", [1, 7, 64])
def test_pieces_give_what_the_whole_gives(size):
    times, attention = np.arange(0, 8, 1 / 30), Attention(SHIFTS)
    whole = np.stack(attention.find_angles(times))
    parts = np.concatenate([np.stack(attention.find_angles(times[k : k + size])) for k in range(0, len(times), size)], 1)
    np.testing.assert_allclose(whole, parts, atol=1e-12)


def test_everybody_looks_at_the_one_who_speaks():
    ann, bob, cleo = person((0, 4), (20, 24)), person((5, 9), (12.0, 12.3)), person((10, 19))
    shifts = plan_attention(ann, [bob, cleo], [30.0, -30.0], seed=1)
    attention = Attention(shifts)
    looks = {time: float(np.degrees(attention.find_angles(np.array([time]))[0][0])) for time in (6.0, 8.9, 11.0, 12.8, 18.0)}
    assert looks == pytest.approx({6.0: 30.0, 8.9: 30.0, 11.0: -30.0, 12.8: -30.0, 18.0: -30.0}), "a short sound takes no turn"
    late = [time - start for time, _ in shifts for start in (5, 10) if 0 <= time - start < 1]
    assert all(0.2 <= each <= 0.5 for each in late)


def test_who_speaks_looks_at_all_others_in_turn():
    shifts = plan_attention(person((0, 300)), [person((301, 305)), person(), person()], [45.0, 0.0, -45.0], seed=3)
    angles = [shift.angle for shift in shifts if shift.time < 300]
    assert {45.0, 0.0, -45.0} == set(angles)
    assert min(angles.count(each) for each in set(angles)) > 0.2 * len(angles)
    assert np.diff([shift.time for shift in shifts]).min() >= 0.9
    assert plan_attention(person((0, 300)), [person()], [20.0], seed=3) == [AttentionShift(0.0, 20.0)]


def test_seats_around_a_table_are_alike_for_all():
    assert find_seats(2) == [[0.0, 0.0], [0.0, 0.0]]
    assert find_seats(3)[0] == [0.0, 30.0, -30.0]
    for count in (3, 4, 5, 8):
        for k, row in enumerate(find_seats(count)):
            assert row[(k + 1) % count] == -row[(k - 1) % count] > 0, "the next one is to the left"
            assert max(row) <= 60


def test_in_a_row_the_middle_one_turns_to_both_sides_and_the_outer_ones_to_the_middle():
    row = find_row(3, 26.0)
    assert row[1] == [-40.0, 0.0, 40.0]
    assert row[0] == [0.0, 14.0, 22.0]
    assert row[2] == [-22.0, -14.0, 0.0]
    assert np.abs([angle for count in range(2, 7) for row in find_row(count, 26.0) for angle in row]).max() <= 60
