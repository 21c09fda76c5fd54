"""Emotions that change over a speech: tracks, their files, and what performances make of them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from cospeech import models
from cospeech.audio.emotions import EMOTIONS, EmotionTrack, emotion_track, read_emotion_track
from cospeech.audio.speech import Speech
from cospeech.cli.demo import EXAMPLE
from cospeech.cli.main import app
from cospeech.errors import InputError
from cospeech.generate import generate_files
from cospeech.motion.motion import Motion
from cospeech.motion.skeletons.arkit import ARKIT_INDEX
from cospeech.rules import RuleBasedModel
from cospeech.rules.emotion_modifiers import MANNERS

HAPPY, ANGRY = EMOTIONS.index("happiness"), EMOTIONS.index("anger")


def one(name: str, weight: float = 1.0) -> np.ndarray:
    row = np.zeros(8)
    row[EMOTIONS.index(name)] += weight
    row[0] += 1 - weight
    return row


def write_track(tmp_path, text: str | bytes):
    path = tmp_path / "track.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def talk(seconds: float) -> Speech:
    return Speech(np.resize(Speech.load(EXAMPLE).samples, round(16_000 * seconds)))


def test_the_eight_emotions_are_those_of_beat_and_of_the_manners():
    assert EMOTIONS == ("neutral", "happiness", "anger", "sadness", "contempt", "surprise", "fear", "disgust")
    assert tuple(MANNERS) == EMOTIONS


def test_a_track_is_linear_between_its_times_and_held_at_the_ends():
    rng = np.random.default_rng(0)
    times, weights = np.sort(rng.uniform(0, 60, 20)), rng.dirichlet(np.ones(8), 20)
    track, moments = EmotionTrack(times, weights), np.concatenate([rng.uniform(-10, 80, 300), times])
    got = track.at(moments)
    assert np.allclose(got, np.stack([np.interp(moments, times, column) for column in weights.T], -1), atol=1e-12)
    assert np.allclose(got.sum(1), 1)
    assert got.min() >= 0
    assert track.at(np.zeros((2, 3))).shape == (2, 3, 8)
    assert track.at(np.array(1.0)).shape == (8,)
    assert np.array_equal(EmotionTrack([0.0, 5e-324], [one("fear"), one("anger")]).at([0.0, 1.0]), [one("fear"), one("anger")])


def test_a_track_keeps_what_it_was_given():
    times, weights = np.array([0.0, 1.0]), np.stack([one("fear"), one("anger")])
    track = EmotionTrack(times, weights)
    weights[:] = 0
    times[:] = 7
    assert np.array_equal(track.at([0.0]), [one("fear")])
    with pytest.raises(ValueError, match="read-only"):
        track.weights[0] = 0
    assert np.array_equal(EmotionTrack.constant("disgust").at([-3.0, 3.0]), [one("disgust")] * 2)


@pytest.mark.parametrize(
    ("times", "weights", "match"),
    [
        ([], np.zeros((0, 8)), "times"), ([0.0], [one("fear")[:7]], "weights"), ([0.0, 0.0], [one("fear")] * 2, "ascend"),
        ([1.0, 0.5], [one("fear")] * 2, "ascend"), ([np.nan], [one("fear")], "ascend"), ([np.inf], [one("fear")], "ascend"),
        ([0.0], [one("fear") * 0.5], "shares"), ([0.0], [one("fear") * 2 - one("anger")], "shares"),
        ([0.0], [np.full(8, np.nan)], "shares"), (["a"], [one("fear")], "numbers"), ([[0.0]], [one("fear")], "times"),
    ],
)  # fmt: skip
def test_what_is_no_track(times, weights, match):
    with pytest.raises(InputError, match=match):
        EmotionTrack(times, weights)


def test_what_a_session_may_be_asked_for():
    track = EmotionTrack.constant("fear")
    assert emotion_track(track) is track
    assert emotion_track("auto") is None
    assert np.array_equal(emotion_track("anger").at([5.0]), [one("anger")])
    for wrong, match in (
        ("angr", "anger"),
        ("Auto", "auto"),
        (None, "None"),
        (3, "3"),
        (["anger"], "anger"),
        (np.ones((10, 8)), "or a track"),
        ("x" * 900, "xxx"),
    ):
        with pytest.raises(InputError, match=match):
            emotion_track(wrong)
    with pytest.raises(InputError, match="anger"):
        EmotionTrack.constant("angry")


def test_names_take_over_in_half_a_second(tmp_path):
    path = write_track(tmp_path, "time,emotion\n1,neutral\n4,anger\n")
    for source in (path, str(path)):
        assert np.array_equal(emotion_track(source).at([9.0]), [one("anger")])
    track = read_emotion_track(
        write_track(tmp_path, "time,emotion\n1,neutral\n2.0, happiness\n4,anger\n4.25,fear\n\n9,neutral\n")
    )
    at = track.at([0, 2, 2.25, 2.5, 3.9, 4.0, 4.125, 4.25, 4.5, 4.75, 8.99, 9.25, 99])
    half = (one("happiness") + one("anger")) / 2
    expected = [
        one("neutral"), one("neutral"), one("happiness", 0.5), one("happiness"), one("happiness"), one("happiness"),
        0.75 * one("happiness") + 0.25 * one("anger"), half, (half + one("fear")) / 2, one("fear"), one("fear"),
        one("fear", 0.5), one("neutral"),
    ]  # fmt: skip
    assert np.allclose(at, expected, atol=1e-9)


def test_a_weight_leaves_the_rest_to_neutral(tmp_path):
    track = read_emotion_track(write_track(tmp_path, "time,emotion,weight\n0,anger,0.4\n3,anger,\n5,neutral,0.2\n"))
    assert np.allclose(track.at([0, 3.25, 4, 9]), [one("anger", 0.4), one("anger", 0.7), one("anger"), one("neutral")])


def test_columns_are_shares_at_moments(tmp_path):
    text = "\ufefftime, happiness ,anger\r\n0,0.5,0\r\n2,1,1\r\n4,,0.25\r\n"
    track = read_emotion_track(write_track(tmp_path, text))
    both = (one("happiness") + one("anger")) / 2
    expected = [one("happiness", 0.5), (one("happiness", 0.5) + both) / 2, both, one("anger", 0.25)]
    assert np.allclose(track.at([-1, 1, 2, 5]), expected)
    track = read_emotion_track(write_track(tmp_path, "time,neutral,fear\n0,1,1\n"))
    assert np.allclose(track.at([0]), [one("fear", 0.5)])


@pytest.mark.parametrize("mark", [";", "\t"])
def test_spreadsheets_may_write_semicolons_tabs_and_decimal_commas(tmp_path, mark):
    rows = ["time,emotion,weight", "0.5,anger,0.4", "3,anger,", "5.25,neutral,0.2"]
    expected = read_emotion_track(write_track(tmp_path, "\n".join(rows)))
    text = "\r\n".join(row.replace(",", mark).replace(".", ",") for row in rows)
    track = read_emotion_track(write_track(tmp_path, "\ufeff" + text))
    assert np.array_equal(track.times, expected.times)
    assert np.array_equal(track.weights, expected.weights)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "is empty"), ("\n\n", "is empty"), ("time,emotion\n", "no row"), ("emotion,time\nfear,0\n", "line 1: header"),
        ("time\n0\n", "line 1: header"), ("time,emotoin\n0,fear\n", "line 1: column 'emotoin'"),
        ("time,hapiness\n0,1\n", "did you mean 'happiness'"), ("time,fear,fear\n0,1,0\n", "line 1: two columns"),
        ("time,emotion\n\n0,fear\n1,angr\n", "line 4: 'angr' is no emotion .did you mean 'anger'"),
        ("time,emotion\n0,auto\n5,sadness\n", "line 2: 'auto' is no emotion .a file says all of it; --stretch"),
        ("time,emotion\n0,Joy\n", "line 2: 'Joy' is no emotion .did you mean 'happiness'"),
        ("time,emotion\n0,fear\nx,fear\n", "line 3: time 'x' is no number"), ("time,emotion\nnan,fear\n", "line 2: time 'nan'"),
        ("time,emotion\n1,fear\n1,anger\n", "line 3: time 1 after 1"), ("time,emotion\n-1,fear\n", "line 2: time -1"),
        ("time,emotion\n1e9,fear\n", r"line 2: time 1e\+09"), ("time,emotion\n0,fear,1\n", "line 2: 3 cells"),
        ("time,emotion,weight\n0,fear,2\n", "line 2: weight 2"), ("time,emotion,weight\n0,fear,x\n", "line 2: weight 'x'"),
        ("time,fear\n0,-0.1\n", "line 2: fear -0.1"), ("time,fear\n0,60\n", "line 2: fear 60"),
        ("time|emotion\n0|fear\n", "line 1: header"), ("time;emotion\n0,5;fear;1\n", "line 2: 3 cells"),
        (b"time,emotion\n0,\xff\n", "no UTF-8 text at byte 15"),
        ("time,emotion\n" + "\n".join(f"{k},fear" for k in range(100_001)), "100,000 rows"),
        ('time,emotion\n0,"' + "x" * 200_000, "line 2"),
    ],
)  # fmt: skip
def test_files_that_are_no_track_say_where(tmp_path, text, match):
    with pytest.raises(InputError, match=match) as error:
        read_emotion_track(write_track(tmp_path, text))
    assert "track.csv" in str(error.value)
    assert len(str(error.value)) < 400


def test_files_that_cannot_be_read(tmp_path):
    for path in (tmp_path / "none.csv", tmp_path, "a\0b.csv"):
        with pytest.raises(InputError, match="cannot read"):
            read_emotion_track(path)
    (tmp_path / "large.csv").write_bytes(b"time,emotion\n" + b" " * (17 << 20))
    with pytest.raises(InputError, match="larger than 16 MiB"):
        read_emotion_track(tmp_path / "large.csv")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_damaged_files_give_a_track_or_say_what_is_wrong(tmp_path, seed):
    rng = np.random.default_rng(seed)
    texts = (b"time,emotion,weight\n0,fear,0.5\n1.5,anger,1\n7,neutral,\n", b"time,fear,anger\n0,0.5,0.5\n1,0,1\n3.5,,1\n")
    path = tmp_path / "track.csv"
    for _ in range(400):
        data = bytearray(texts[rng.integers(2)])
        for _ in range(rng.integers(1, 6)):
            at = int(rng.integers(len(data)))
            piece = bytes(rng.choice(list(b'0123456789.,-e\n\r";ai\0\xff '), rng.integers(0, 4)).astype(np.uint8))
            data[at : at + int(rng.integers(3))] = piece
            data = data or bytearray(b",")
        path.write_bytes(data)
        try:
            weights = read_emotion_track(path).at(np.linspace(-1, 20, 50))
        except InputError:
            continue
        assert np.allclose(weights.sum(1), 1)
        assert weights.min() >= 0


TRACK = EmotionTrack([0.0, 4.0, 4.5], [one("happiness"), one("happiness"), one("anger")])


@pytest.mark.slow
def test_a_face_follows_a_track():
    speech = talk(9)
    options = {"seed": 3, "parts": ("face",)}
    face = RuleBasedModel().generate(speech, emotion=TRACK, **options).face
    happy, angry = (RuleBasedModel().generate(speech, emotion=name, **options).face for name in ("happiness", "anger"))
    smile, brow = ARKIT_INDEX["mouthSmileLeft"], ARKIT_INDEX["browDownLeft"]
    assert np.allclose(face[:120, [smile, brow]], happy[:120, [smile, brow]], atol=1e-6)
    assert np.allclose(face[136:, [smile, brow]], angry[136:, [smile, brow]], atol=1e-6)
    assert face[136:, brow].mean() > face[:120, brow].mean() + 0.3


@pytest.mark.slow
def test_a_track_in_pieces_is_the_whole():
    speech, gesturer = talk(9), RuleBasedModel()
    whole = gesturer.generate(speech, emotion=TRACK, seed=5)
    pieces = Motion.concatenate(list(gesturer.stream(speech.chunks(0.11), emotion=TRACK, seed=5)))
    assert np.allclose(whole.face, pieces.face, atol=1e-6)
    assert np.allclose(whole.rotations, pieces.rotations, atol=1e-6)


@pytest.mark.slow
def test_a_name_is_a_track_that_never_changes():
    speech = talk(4)
    for name in ("neutral", "sadness"):
        of_name, of_track = (
            RuleBasedModel().generate(speech, emotion=e, seed=1) for e in (name, EmotionTrack([0, 9], [one(name)] * 2))
        )
        assert np.array_equal(of_name.rotations, of_track.rotations)
        assert np.array_equal(of_name.face, of_track.face)


@pytest.mark.slow
def test_bodies_follow_a_track():
    def speed(emotion):
        motion = RuleBasedModel().generate(talk(48), emotion=emotion, seed=2)
        hands = motion.positions()[:, [motion.skeleton.index[side + "Hand"] for side in ("left", "right")]]
        return np.linalg.norm(np.diff(hands, axis=0), axis=-1).mean(1)

    rows = [one("anger"), one("anger"), one("sadness"), one("sadness")]
    calming = speed(EmotionTrack([0, 23.8, 24.2, 48], rows))
    assert calming[30:690].mean() > 1.5 * calming[750:].mean()
    back = speed(EmotionTrack([0, 23.8, 24.2, 48], rows[::-1]))
    assert back[750:].mean() > 1.5 * back[30:690].mean()


@pytest.mark.slow
def test_the_report_has_the_mean_of_the_track(tmp_path):
    wav = write_track(tmp_path, "time,emotion\n0,happiness\n5,anger\n")
    report = generate_files(EXAMPLE, [tmp_path / "a.npz"], emotion=wav, report=tmp_path / "report.json")
    track, seconds = read_emotion_track(wav), report.speech_seconds
    expected = track.at(np.arange(0, seconds, 0.01)).mean(0)
    assert np.allclose([report.emotion[name] for name in EMOTIONS], expected, atol=0.02)
    assert json.loads((tmp_path / "report.json").read_text())["speaker"] is None
    of_name = generate_files(EXAMPLE, [tmp_path / "a.npz"], emotion="fear")
    assert of_name.emotion == {name: float(name == "fear") for name in EMOTIONS}


@pytest.mark.slow
def test_the_command_takes_a_file(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    monkeypatch.chdir(tmp_path)
    write_track(tmp_path, "time,emotion\n0,happiness\n3,anger\n")
    line = ["generate", str(EXAMPLE), "-o", "a.npz", "--emotion", "track.csv", "--report", "r.json", "-q"]
    result = CliRunner().invoke(app, line)
    assert result.exit_code == 0, result.output
    emotion = json.loads((tmp_path / "r.json").read_text())["emotion"]
    assert emotion["happiness"] + emotion["anger"] == pytest.approx(1)
    with pytest.raises(InputError, match="would overwrite what is read"):
        generate_files(EXAMPLE, ["x.csv"], emotion=write_track(tmp_path, "time,emotion\n0,fear\n").rename(tmp_path / "x.csv"))
    with pytest.raises(InputError, match=r"none\.csv"):
        generate_files(EXAMPLE, ["x.npz"], emotion="none.csv")
    assert not (tmp_path / "x.npz").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stylised-flow", "mix-stage"])
def test_trained_systems_take_tracks(name):
    speech, model = talk(3), models.load(name)
    session = model.session(emotion=TRACK)
    motions = [motion for motion in (*session.push(speech), *session.finish())]
    assert sum(map(len, motions)) == 90
    assert session.emotion["happiness"] == pytest.approx(1)
    assert session.speaker is None
    with pytest.raises(InputError, match="hapy"):
        model.session(emotion="hapy")
