"""A video of several characters side by side, with the sound of all."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.audio.sound_mix import SoundMix
from cospeech.errors import InputError
from cospeech.export.group_film import write_group_film
from cospeech.motion.frame_pieces import cut_alike
from cospeech.motion.motion import Motion
from tests.export.test_video import clicks, decode_film, jumping

av = pytest.importorskip("av", reason="needs PyAV: cospeech[av]")


def pieces(motion, size):
    return (motion[at : at + size] for at in range(0, len(motion), size))


def test_streams_are_cut_at_the_same_frames():
    first, second = jumping(50, 20), jumping(40, 10)
    pairs = list(cut_alike([pieces(first, 7), pieces(second, 12)]))
    assert all(len(one) == len(other) for one, other in pairs)
    for whole, parts in ((first, [one for one, _ in pairs]), (second, [other for _, other in pairs])):
        together = Motion.concatenate(parts)
        assert len(together) == 40
        assert np.array_equal(together.rotations, whole.rotations[:40])


def test_sounds_are_added_and_the_longer_one_goes_on(tmp_path):
    one = clicks(tmp_path / "a.wav", [0.2], 0.5, rate=48_000)
    other = clicks(tmp_path / "b.wav", [0.2, 0.8], 1.0, rate=48_000)
    mix = SoundMix([one, other], 48_000)
    sound = np.concatenate(list(mix.blocks()))
    mix.close()
    assert len(sound) == 48_000
    assert sound[9_610] == pytest.approx(1.6, abs=1e-3)
    assert sound[38_410] == pytest.approx(0.8, abs=1e-3)


def test_each_character_moves_in_its_own_pane_and_all_are_heard(tmp_path):
    sounds = [clicks(tmp_path / "a.wav", [0.3], 1.2), clicks(tmp_path / "b.wav", [0.8], 1.2)]
    moving = zip(pieces(jumping(36, 10), 36), pieces(jumping(36, 25), 36), strict=True)
    path = tmp_path / "both.mp4"
    write_group_film(path, moving, fps=30, sounds=sounds, avatars=[None, None])
    pictures, times, sound, _ = decode_film(path)
    assert pictures.shape == (36, 720, 1280, 3)
    assert times[-1] == pytest.approx(35 / 30, abs=1e-3)
    change = np.abs(np.diff(pictures.astype(int), axis=0)).sum((1, 3))
    left, right = change[:, :640].sum(1), change[:, 640:].sum(1)
    assert left.argmax() == 9
    assert right.argmax() == 24
    assert left[24] < 0.1 * left[9]
    loud = np.flatnonzero(np.abs(sound) > 0.2) / 48_000
    assert loud.min() == pytest.approx(0.3, abs=0.05)
    assert loud.max() == pytest.approx(0.8, abs=0.05)


def test_two_are_seen_from_the_side_of_the_other_one(tmp_path):
    """The same pose in both panes is nearly the mirror image of the other: one faces right, the other one left."""
    motion = jumping(3, 3)
    write_group_film(tmp_path / "both.mp4", [[motion, motion]], fps=30, avatars=[None, None])
    picture = decode_film(tmp_path / "both.mp4")[0][0].astype(float)
    left, right = picture[:, :640], picture[:, 640:]
    assert np.abs(left - right[:, ::-1]).mean() < 0.75 * np.abs(left - right).mean()


@pytest.mark.parametrize("count", [1, 7])
def test_too_few_or_too_many_characters_are_refused(tmp_path, count):
    with pytest.raises(InputError, match=f"a film of {count} character"):
        write_group_film(tmp_path / "x.mp4", [], fps=30, avatars=[None] * count)


def test_an_error_leaves_no_file_and_no_process(tmp_path):
    def fail():
        yield [jumping(40, 3), jumping(40, 3)]
        raise InputError("the second piece")

    with pytest.raises(InputError, match="the second piece"):
        write_group_film(tmp_path / "x.mp4", fail(), fps=30, avatars=[None, None])
    assert list(tmp_path.iterdir()) == []
