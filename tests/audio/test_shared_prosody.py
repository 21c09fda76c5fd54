"""One analysis for several listeners: each gets the bits of an analysis of its own; pieces that all have read are dropped."""

from __future__ import annotations

import pytest

from cospeech.audio.features.prosody import Features, ProsodyStream
from cospeech.audio.features.shared_prosody import Prosody, SharedProsody
from tests.support.runtime_bundles import talk

SOUND = talk(6.0).samples


def push_pieces(who: Prosody, sizes: list[int]) -> Features:
    pieces, at = [], 0
    for turn in range(len(SOUND)):
        size = sizes[turn % len(sizes)]
        pieces.append(who.push(SOUND[at : at + size]))
        at += size
        if at >= len(SOUND):
            break
    return Features.concatenate([*pieces, who.flush()])


def alike(a: Features, b: Features) -> bool:
    return all(
        getattr(a, n).tobytes() == getattr(b, n).tobytes() for n in ("energy", "pitch", "voicing", "onset", "bands", "mel")
    )


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [[160], [533, 1], [16_000], [len(SOUND)]], ids=str)
def test_whoever_comes_first_all_hear_the_same(sizes):
    prosody, alone = SharedProsody(), push_pieces(ProsodyStream(mel=True), [1600])
    first, second = prosody.tap(), prosody.tap()
    assert alike(push_pieces(first, sizes), alone)
    assert alike(push_pieces(second, [1600]), alone)  # from its beginning, after the other has finished


def test_listeners_take_turns_and_what_all_have_read_is_dropped():
    prosody, alone, pieces = SharedProsody(), push_pieces(ProsodyStream(mel=True), [1600]), ([], [])
    taps = prosody.tap(), prosody.tap()
    for at in range(0, len(SOUND), 3200):
        whole = SOUND[at : at + 3200]
        pieces[0].append(taps[0].push(whole))
        pieces[1].extend([taps[1].push(whole[:1000]), taps[1].push(whole[1000:])])
        assert not prosody._pieces
    for tap, parts in zip(taps, pieces, strict=True):
        assert alike(Features.concatenate([*parts, tap.flush()]), alone)
    assert len(taps[0].flush()) == 0
