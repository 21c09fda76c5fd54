"""One analysis for several listeners: everybody gets what he would have worked out himself, to the bit; nothing is hoarded."""

from __future__ import annotations

import pytest

from cospeech.audio.features.prosody import Features, ProsodyStream
from cospeech.audio.features.shared_prosody import Prosody, SharedProsody
from tests.support.runtime_bundles import talk

SOUND = talk(6.0).samples


def heard(who: Prosody, sizes: list[int]) -> Features:
    made, at = [], 0
    for turn in range(len(SOUND)):
        size = sizes[turn % len(sizes)]
        made.append(who.push(SOUND[at : at + size]))
        at += size
        if at >= len(SOUND):
            break
    return Features.concatenate([*made, who.flush()])


def alike(a: Features, b: Features) -> bool:
    return all(
        getattr(a, n).tobytes() == getattr(b, n).tobytes() for n in ("energy", "pitch", "voicing", "onset", "bands", "mel")
    )


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [[160], [533, 1], [16_000], [len(SOUND)]], ids=str)
def test_whoever_comes_first_all_hear_the_same(sizes):
    shared, alone = SharedProsody(), heard(ProsodyStream(mel=True), [1600])
    first, second = shared.tap(), shared.tap()
    assert alike(heard(first, sizes), alone)
    assert alike(heard(second, [1600]), alone)  # from its beginning, after the other has finished


def test_listeners_by_turns_and_what_all_have_had_is_forgotten():
    shared, alone, made = SharedProsody(), heard(ProsodyStream(mel=True), [1600]), ([], [])
    taps = shared.tap(), shared.tap()
    for at in range(0, len(SOUND), 3200):
        whole = SOUND[at : at + 3200]
        made[0].append(taps[0].push(whole))
        made[1].extend([taps[1].push(whole[:1000]), taps[1].push(whole[1000:])])
        assert not shared._pieces
    for tap, parts in zip(taps, made, strict=True):
        assert alike(Features.concatenate([*parts, tap.flush()]), alone)
    assert len(taps[0].flush()) == 0
