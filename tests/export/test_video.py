"""Videos, moving pictures and strips, read back by other programs' readers: length, sync, content, and nothing half-written."""

from __future__ import annotations

import itertools
import sys
from fractions import Fraction

import numpy as np
import pytest
import soundfile
from PIL import Image

from cospeech.audio.speech import Word
from cospeech.errors import InputError
from cospeech.export import open_writer
from cospeech.export.film_encoder import FilmEncoder
from cospeech.export.pictures import render_motion
from cospeech.export.registry import suffixes
from cospeech.export.render.patch import Patch
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat
from cospeech.motion.skeleton import humanoid
from tests.support.motions import gesturing

av = pytest.importorskip("av", reason="needs PyAV: cospeech[av]")

SMALL = {"size": (64, 48)}


def decode_film(path):
    """All pictures (N, H, W, 3), their times, the sound and the time of its first sample, of an .mp4."""
    with av.open(str(path)) as file:
        frames = list(file.decode(video=0))
        pictures = np.stack([frame.to_ndarray(format="rgb24") for frame in frames])
        times = [frame.time for frame in frames]
    with av.open(str(path)) as file:
        if not file.streams.audio:
            return pictures, times, None, None
        sound = [(frame.time, frame.to_ndarray()[0]) for frame in file.decode(audio=0)]
    return pictures, times, np.concatenate([samples for _, samples in sound]), sound[0][0]


def clicks(path, at, seconds, rate=22_050):
    samples = np.zeros(round(seconds * rate), np.float32)
    for time in at:
        start = round(time * rate)
        samples[start : start + 40] = 0.8
    soundfile.write(path, samples, rate)
    return path


def jumping(frames, when, fps=30.0):
    """Stands still, and from frame ``when`` on with both arms out."""
    skeleton = humanoid()
    motion = gesturing(1, fps)
    rotations = np.repeat(motion.rotations, frames, 0)
    for side, sign in (("left", -1), ("right", 1)):
        rotations[when:, skeleton.index[f"{side}UpperArm"]] = axis_angle_to_quat((0, 0, 1), sign * 0.2)
    return Motion(fps=fps, rotations=rotations, root=np.repeat(motion.root, frames, 0))


@pytest.mark.slow
@pytest.mark.parametrize(("fps", "frames"), [(30.0, 20), (25.0, 13), (29.97, 20), (60.0, 21)])
def test_mp4_has_a_picture_per_frame(tmp_path, fps, frames):
    gesturing(frames, fps).save(tmp_path / "a.mp4", **SMALL)
    pictures, times, sound, _ = decode_film(tmp_path / "a.mp4")
    assert pictures.shape == (frames, 48, 64, 3)
    assert np.allclose(times, np.arange(frames) / fps, atol=1e-4)
    assert sound is None
    with av.open(str(tmp_path / "a.mp4")) as file:
        stream = file.streams.video[0]
        assert stream.codec_context.name in ("h264", "mpeg4")
        assert stream.codec_context.pix_fmt == "yuv420p"
        assert float(stream.duration * stream.time_base) == pytest.approx(frames / fps, abs=1e-3)


@pytest.mark.slow
def test_mp4_sound_and_picture_are_in_sync(tmp_path):
    fps, when = 30.0, 9
    speech = clicks(tmp_path / "click.wav", [when / fps], 0.7)
    jumping(21, when, fps).save(tmp_path / "a.mp4", audio=speech, **SMALL)
    pictures, times, sound, first = decode_film(tmp_path / "a.mp4")
    change = np.abs(np.diff(pictures.astype(float), axis=0)).mean((1, 2, 3))
    assert np.argmax(change) + 1 == when
    assert change.max() > 8 * np.median(change)
    rate = 48_000
    click = first + np.argmax(np.abs(sound) > 0.3) / rate
    assert click == pytest.approx(times[when], abs=0.005)  # a frame lasts 0.033 s
    assert first + len(sound) / rate == pytest.approx(0.7, abs=0.05)


def test_mp4_starts_with_its_index(tmp_path):
    gesturing(12).save(tmp_path / "a.mp4", **SMALL)
    data = (tmp_path / "a.mp4").read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


@pytest.mark.slow
def test_mp4_in_pieces_with_long_sound_and_odd_size(tmp_path):
    speech = clicks(tmp_path / "click.wav", [0.1, 1.9], 2.0)
    motion = gesturing(15)
    with open_writer(tmp_path / "A.MP4", skeleton=motion.skeleton, fps=30, audio=speech, size=(63, 47)) as writer:
        for piece in (motion[:4], motion[4:5], motion[5:]):
            writer.write(piece)
    pictures, times, sound, _ = decode_film(tmp_path / "A.MP4")
    assert pictures.shape == (15, 48, 64, 3)
    assert len(times) == 15
    assert len(sound) >= 0.5 * 48_000


@pytest.mark.slow
def test_mp4_is_the_same_every_time(tmp_path):
    speech = clicks(tmp_path / "click.wav", [0.1], 0.5)
    for name in "ab":
        gesturing(15).save(tmp_path / f"{name}.mp4", audio=speech, **SMALL)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_mp4_shows_the_colours_that_were_drawn(tmp_path):
    render_motion(gesturing(3), tmp_path / "a.mp4", size=(64, 48), background=(200, 120, 40))
    pictures, *_ = decode_film(tmp_path / "a.mp4")
    assert pictures[1, 20, 2].astype(float) == pytest.approx((200, 120, 40), abs=14)


def test_mp4_without_pyav_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(InputError, match=r'in a clone: pip install -e "\.\[av\]"'):
        gesturing(3).save(tmp_path / "a.mp4")
    assert list(tmp_path.iterdir()) == []


def test_rates_other_than_the_motions(tmp_path):
    render_motion(gesturing(20, 60), tmp_path / "a.mp4", size=(64, 48), fps=30)
    pictures, times, *_ = decode_film(tmp_path / "a.mp4")
    assert len(pictures) == 10
    assert np.allclose(np.diff(times), 1 / 30)


@pytest.mark.slow
def test_gif_plays_at_the_right_speed_and_loops(tmp_path):
    gesturing(44).save(tmp_path / "a.gif", size=(64, 64))
    with Image.open(tmp_path / "a.gif") as picture:
        assert picture.n_frames == 22
        assert picture.info["loop"] == 0
        durations, frames = [], []
        for k in range(picture.n_frames):
            picture.seek(k)
            durations.append(picture.info["duration"])
            frames.append(np.asarray(picture.convert("RGB")).astype(float))
    assert abs(sum(durations) / 1000 - 22 / 15) < 0.01
    moving = [np.abs(a - b).mean() for a, b in itertools.pairwise(frames)]
    assert max(moving) > 0.3


@pytest.mark.slow
def test_gif_pictures_are_those_drawn(tmp_path, monkeypatch):
    from cospeech.export.gif import Writer

    pictures = []
    append = Writer._append
    monkeypatch.setattr(Writer, "_append", lambda self, picture: pictures.append(picture) or append(self, picture))
    gesturing(70).save(tmp_path / "a.gif", size=(64, 64))
    assert len(pictures) == 35
    with Image.open(tmp_path / "a.gif") as picture:
        for k, expected in enumerate(pictures):
            picture.seek(k)
            frame = np.asarray(picture.convert("RGB")).astype(float)
            assert np.abs(frame - expected).mean() < 2.5


def test_gif_of_one_frame_that_does_not_move(tmp_path):
    jumping(8, 8).save(tmp_path / "a.gif", size=(32, 32))
    with Image.open(tmp_path / "a.gif") as picture:
        assert picture.n_frames == 4


@pytest.mark.slow
def test_strip(tmp_path):
    speech = clicks(tmp_path / "click.wav", [0.5, 1.5, 2.5], 3.0)
    words = [Word("one", 0.4, 0.7), Word("two", 1.4, 1.7), Word("三", 2.4, 2.7)]
    gesturing(90).save(tmp_path / "a.png", audio=speech, words=words, size=(800, 330))
    with Image.open(tmp_path / "a.png") as picture:
        sheet = np.asarray(picture.convert("RGB")).astype(int)
    assert sheet.shape == (330, 800, 3)
    blue = (np.abs(sheet - (190, 207, 222)).sum(-1) < 12).any(0)  # the waveform's columns
    red = (np.abs(sheet - (214, 92, 66)).sum(-1) < 60)[:, :].any(0)  # the marks
    assert not blue[100:120].any()
    for click in (0.5, 1.5, 2.5):
        x = round(9.6 + (800 - 19.2) * click / 3.0)
        assert blue[x - 3 : x + 6].any()
    assert red.sum() > 25
    cells = sheet[20:150].std(axis=(0, 2))
    assert np.count_nonzero(cells > 20) > 200  # figures, not blank panels


@pytest.mark.parametrize("frames", [1, 2, 40])
def test_strip_of_short_motion_without_sound(tmp_path, frames):
    gesturing(frames).save(tmp_path / "a.png", size=(400, 200))
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (400, 200)
        assert np.asarray(picture).std() > 10


@pytest.mark.parametrize("suffix", suffixes(lambda entry: entry.picture))
def test_bad_input_is_told_and_leaves_nothing(tmp_path, suffix):
    target, motion = tmp_path / f"a{suffix}", gesturing(2)
    text = tmp_path / "talk.wav"
    text.write_text("this is not sound " * 100)
    wrong = [{"camera": "drone"}, {"size": (-1, 5)}, {"size": "big"}, {"background": (1, 2, 300)}, {"background": "red"}]
    wrong += [] if suffix == ".gif" else [{"audio": text}, {"audio": tmp_path / "none.wav"}]
    for options in wrong:
        with pytest.raises(InputError):
            render_motion(motion, target, **options)
    with pytest.raises(InputError, match="no frames"):
        render_motion(motion[:0], target)
    with pytest.raises(InputError, match=r"someone\.vrm"):
        motion.save(target, avatar=tmp_path / "someone.vrm")
    assert list(tmp_path.iterdir()) == [text]


def test_render_motion_knows_its_formats(tmp_path):
    with pytest.raises(InputError, match=r"ends in \.mp4"):
        render_motion(gesturing(2), tmp_path / "a.avi")
    with pytest.raises(InputError, match="leave fps out"):
        render_motion(gesturing(2), tmp_path / "a.png", fps=12)
    with pytest.raises(InputError, match="pictures per second"):
        render_motion(gesturing(2), tmp_path / "a.mp4", fps=float("nan"))
    with pytest.raises(InputError, match="pictures per second"):
        render_motion(gesturing(2), tmp_path / "a.gif", fps=80)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_film_leaves_nothing(tmp_path):
    motion = gesturing(10)

    def interrupt():
        with open_writer(tmp_path / "a.mp4", skeleton=motion.skeleton, fps=30, **SMALL) as writer:
            writer.write(motion)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupt()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("rate", [16_000, 48_000])
def test_sound_ends_with_the_pictures(tmp_path, rate):
    soundfile.write(tmp_path / "long.wav", np.full(5 * rate, 0.1, np.float32), rate)
    blank = np.zeros((16, 16, 3), np.uint8)
    film = FilmEncoder(tmp_path / "a.mp4", (16, 16), 30.0, blank, [tmp_path / "long.wav"])
    for _ in range(15):
        film.add(Patch(0, 0, blank[:0]))
    film.close()
    film.discard()
    with av.open(str(tmp_path / "a.mp4")) as file:
        lengths = {stream.type: float(stream.duration * stream.time_base) for stream in file.streams}
    assert lengths == {"video": pytest.approx(0.5, abs=1e-3), "audio": pytest.approx(0.5, abs=0.03)}  # a frame of AAC: 21 ms


@pytest.mark.slow
def test_length_by_the_book(tmp_path):
    for seconds, fps in ((Fraction(1, 3), 30), (Fraction(41, 100), 24)):
        frames = int(np.ceil(seconds * fps))
        gesturing(frames, fps).save(tmp_path / "a.mp4", **SMALL)
        with av.open(str(tmp_path / "a.mp4")) as file:
            stream = file.streams.video[0]
            assert stream.duration * stream.time_base == Fraction(frames, fps)
