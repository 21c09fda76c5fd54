"""`cospeech stream` as a user runs it: frames come in order, at the right times, and are those that `generate` makes."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cospeech.audio.speech import Speech, example
from cospeech.cli.stream import _play as play
from cospeech.cli.stream import _play_to_the_end as play_to_the_end
from cospeech.cli.stream import _shut_mouth as shut_mouth
from cospeech.errors import InputError
from cospeech.export import save
from cospeech.export.live.pacing import FramePacer
from cospeech.generate import open_live_session
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT_INDEX
from tests.support.command_line import heed
from tests.support.motions import gesturing

COMMAND = [sys.executable, "-m", "cospeech", "stream"]


def lines(output: bytes) -> tuple[dict, list[dict], dict]:
    start, *frames, end = (json.loads(line) for line in output.splitlines())
    return start, frames, end


@pytest.mark.slow
@pytest.mark.parametrize("model", ["rules", "chain-of-generation"])
def test_the_frames_of_a_file_are_those_of_a_session(model, tmp_path):
    import soundfile

    speech = Speech.load(example()[0]).window(0, 2.5)
    soundfile.write(tmp_path / "talk.wav", speech.samples, speech.rate, subtype="FLOAT")
    command = [*COMMAND, "-i", "talk.wav", "--to", "-", "--unpaced", "--model", model, "--fps", "30", "--quiet"]
    start, frames, end = lines(subprocess.run(command, cwd=tmp_path, capture_output=True, check=True).stdout)
    assert [frame["frame"] for frame in frames] == list(range(75))
    assert end == {"type": "end", "frames": 75}
    session = open_live_session(model, fps=30)
    motion = [piece for chunk in Speech.load(tmp_path / "talk.wav").chunks(0.02) for piece in session.push(chunk)]
    motion += list(session.finish())
    for name in ("rotations", "root", "face"):
        expected = np.concatenate([getattr(piece, name) for piece in motion])
        np.testing.assert_allclose([frame[name] for frame in frames], expected, atol=1e-5)
    assert start["latency"] == pytest.approx(session.latency + 0.08, abs=1e-3)


@pytest.mark.slow
def test_raw_samples_on_standard_input_end_the_stream():
    samples = (np.sin(np.arange(4000) / 20) * 8000).astype("<i2").tobytes()
    command = [*COMMAND, "-i", "-", "--rate", "8000", "--to", "-", "--fps", "25"]
    process = subprocess.run(command, input=samples, capture_output=True, check=True)
    _, frames, _ = lines(process.stdout)
    assert len(frames) >= 13  # half a second; silence where the pipe was slower than the clock
    assert b"frames leave" in process.stderr
    assert b"sent, 0 dropped" in process.stderr


@pytest.mark.slow
def test_words_beside_raw_samples_change_the_motion(tmp_path):
    speech = Speech.load(example()[0], transcript=example()[1]).window(0, 3)
    samples = (speech.samples * 32767).astype("<i2").tobytes()
    text = "".join(json.dumps({"word": each.text, "start": each.start, "end": each.end}) + "\n" for each in speech.words)
    (tmp_path / "words").write_text(text)

    def stream(*more: str) -> np.ndarray:
        command = [*COMMAND, "-i", "-", "--to", "-", "--fps", "25", "--quiet", *more]
        frames = lines(subprocess.run(command, input=samples, cwd=tmp_path, capture_output=True, check=True).stdout)[1]
        return np.array([frame["face"] for frame in frames[:70]])

    plain, words, transcript = stream(), stream("--words", "words"), stream("--transcript", str(example()[1]))
    apart = [np.abs(plain - words).mean(), np.abs(plain - transcript).mean(), np.abs(words - transcript).mean()]
    assert apart[2] < 0.3 * min(apart[:2])  # they differ by silence where the pipe was late
    assert np.abs(words - stream("--words", "words", "--language", "fr")).mean() > apart[2]


@pytest.mark.slow
def test_standard_input_that_ends_within_a_sample_is_played_to_its_end():
    samples = (np.sin(np.arange(4000) / 20) * 8000).astype("<i2").tobytes() + b"x"
    process = subprocess.run(
        [*COMMAND, "-i", "-", "--rate", "8000", "--to", "-", "--fps", "25"], input=samples, capture_output=True
    )
    _, frames, end = lines(process.stdout)
    assert process.returncode == 0
    assert len(frames) == end["frames"] >= 13
    assert b"note: the sound ends within a sample; 1 byte left out" in process.stderr


@pytest.mark.slow
def test_standard_input_without_sound_is_told():
    process = subprocess.run([*COMMAND, "-i", "-", "--to", "-", "--quiet"], input=b"", capture_output=True)
    assert (process.returncode, process.stdout) == (2, b"")
    assert process.stderr == b"error: the input ended without sound (send samples to it before you end it)\n"


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["-i", "nowhere.wav"], "nowhere.wav"),
        (["-i", "-", "--rate", "10"], "10 samples per second"),
        (["-i", "-", "--samples", "u8"], "samples of kind 'u8'"),
        (["-i", "mic", "--transcript", "talk.srt"], "a transcript of the microphone"),
        (["-i", "-", "--transcript", "nowhere.srt"], "nowhere.srt"),
        (["-i", "-", "--words", "nowhere"], "cannot read 'nowhere': there is no such file or pipe (mkfifo words makes a pipe)"),
        (["-i", "-", "--words", "."], "cannot read '.': it is a folder"),
        (["-i", "talk.wav", "--language", "de"], "the language 'de' of no words"),
        (["-i", "-", "--language", "xx"], "no language has the code 'xx'"),
        (["-i", "talk.wav", "--words", "words"], "--words beside a sound file (--transcript gives its words)"),
        (["-i", "-", "--to", "osc://x"], "cannot send to 'osc://x'"),
        (["-i", "-", "--fps", "0"], "fps 0"),
        (["-i", "-", "--model", "nobody"], "nobody"),
        (["-i", "ws://127.0.0.1:9"], "nobody answers"),
        (["-i", "http://x"], "cannot hear sound from 'http://x' (known: mic, a sound file, -, ws://HOST:PORT"),
        (["-i", "vmc://127.0.0.1:1"], "cannot hear sound from 'vmc://127.0.0.1:1'"),
        (["-i", "WS://127.0.0.1:9"], "nobody answers"),
        (["-i", "-", "--control", "foo"], "cannot hear messages from 'foo' (known: -, ws://HOST:PORT, wss://HOST:PORT, listen"),
        (["-i", "-", "--control", "http://x"], "cannot hear messages from 'http://x'"),
        (["-i", "-", "--control", "vmc://"], "cannot hear messages from 'vmc://'"),
        (["-i", "-", "--idle-after", "0"], "error: --idle-after is 0.0 (seconds, the latency of 1.62"),
        (["-i", "-", "--look-ahead", "0.1"], "error: --look-ahead is 0.1"),
        (["-i", "talk.wav", "--rate", "16000"], "--rate beside a sound file (it would change nothing; leave it out)"),
        (["-i", "talk.wav", "--samples", "f32"], "--samples beside a sound file"),
        (["-i", "-", "--avatar", "no.vrm", "--to", "livelink://127.0.0.1"], "--avatar without a vmc:// receiver (it would ch"),
        (["-i", "-", "--to", "vmc://127.0.0.1", "--to", "vmc://127.0.0.1"], "--to 'vmc://127.0.0.1' is given twice"),
        (["-i", "-", "--to", "vmc://"], "write vmc://127.0.0.1:39539"),
    ],
)
def test_what_cannot_be_streamed_is_one_line(cli, arguments, what):
    code, out, err = cli("stream", "--quiet", *arguments)
    assert (code, out) == (2, "")
    assert what in err
    assert err.count("\n") == 1
    assert err.startswith("error: ")


def test_a_map_that_is_not_of_the_avatar_is_refused(cli, tmp_path):
    avatar, names = tmp_path / "me.glb", tmp_path / "names.toml"
    save(gesturing(3), avatar)
    names.write_text('[bones]\nhead = "haed"\n')
    code, _, err = cli("stream", "-q", "-i", example()[0], "--to", "vmc://127.0.0.1", "--avatar", avatar, "--map", names)
    assert (code, err.count("\n")) == (2, 1)
    assert f"error: {str(avatar)!r}: bone map: 'haed' is none of their joints (did you mean 'head'?)" in err


def test_a_gain_of_no_face_is_told(cli):
    _, _, err = cli("stream", "--quiet", "-i", "nowhere.wav", "--parts", "hands", "--face-gain", "1.5")
    assert err.startswith("note: face_gain changes nothing: no face is made\n")


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_stopped_in_mid_word_it_shuts_the_mouth_and_tells_the_counts(number, code):
    command = [*COMMAND, "-i", str(example()[0]), "--to", "-", "--fps", "30"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "bufsize": 0}  # `communicate` skips what a buffer holds
    with subprocess.Popen(command, preexec_fn=heed(signal.SIGINT), **pipes) as process:
        first_lines = [json.loads(process.stdout.readline()) for _ in range(61)]
        jaw = first_lines[0]["face"].index("jawOpen")
        while first_lines[-1]["face"][jaw] < 0.1:
            first_lines.append(json.loads(process.stdout.readline()))
        process.send_signal(number)
        rest, err = process.communicate(timeout=60)
    *frames, end = [*first_lines[1:], *(json.loads(line) for line in rest.splitlines())]
    assert process.returncode == code
    assert [frame["frame"] for frame in frames] == list(range(len(frames)))
    assert end == {"type": "end", "frames": len(frames)}
    assert 15 <= len(frames) + 1 - len(first_lines) <= 40  # half a second, and what had left before the signal was heard
    assert max(frame["face"][jaw] for frame in frames[-3:]) < 0.05
    rotations = np.array([frame["rotations"] for frame in frames])
    steps = 2 * np.degrees(np.arccos(np.clip(np.abs((rotations[1:] * rotations[:-1]).sum(-1)), 0, 1)))
    assert steps[len(first_lines) - 3 :].max() < 20  # no jump: 600 degrees per second, a fast wrist
    assert f"{len(frames)} frames".encode() in err
    assert f"-: {len(frames)} sent, 0 dropped".encode() in err


@pytest.mark.slow
def test_when_the_sound_is_over_the_hands_come_to_rest(tmp_path):
    import soundfile

    speech = Speech.load(example()[0]).window(0, 3)
    soundfile.write(tmp_path / "talk.wav", speech.samples, speech.rate)
    command = [*COMMAND, "-i", "talk.wav", "--to", "-", "--fps", "30", "--quiet"]
    _, frames, end = lines(subprocess.run(command, cwd=tmp_path, capture_output=True, check=True, timeout=60).stdout)
    assert end == {"type": "end", "frames": 135}  # 3 s of sound, and 1.5 s
    rotations, root = np.array([frame["rotations"] for frame in frames]), np.array([frame["root"] for frame in frames])
    hands = humanoid().forward(rotations, root)[0][:, [humanoid().index[side + "Hand"] for side in ("left", "right")], 1]
    assert hands[:90].max() > 1.05
    assert hands[-1].max() < 0.95
    assert max(frame["face"][ARKIT_INDEX["jawOpen"]] for frame in frames[-30:]) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("more", [[], ["--unpaced"]])
def test_a_reader_that_leaves_ends_the_stream(more):
    command = [*COMMAND, "-i", str(example()[0]), "--to", "-", "--fps", "30", "--quiet", *more]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert json.loads(process.stdout.readline())["type"] == "start"
        process.stdout.close()
        left = time.monotonic()
        assert process.stderr.read() == b""
        assert process.wait(60) == 0
        assert time.monotonic() - left < 15  # the sound is 19 s long


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
def test_lines_that_cannot_be_written_end_the_stream():
    command = [*COMMAND, "-i", str(example()[0]), "--to", "-", "--fps", "30", "--quiet"]
    with Path("/dev/full").open("wb") as full:
        process = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, timeout=60)
    assert (process.returncode, process.stderr.count(b"\n")) == (1, 1)
    assert process.stderr.startswith(b"error: No space left on device")


@pytest.mark.slow
def test_stopped_together_with_its_reader_it_was_interrupted():
    command = [*COMMAND, "-i", str(example()[0]), "--to", "-", "--fps", "30", "--quiet"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, preexec_fn=heed(signal.SIGINT), **pipes) as process:
        for _ in range(20):
            process.stdout.readline()
        process.send_signal(signal.SIGINT)
        process.stdout.close()
        assert process.stderr.read() == b"interrupted\n"
        assert process.wait(60) == 130


@pytest.mark.slow
@pytest.mark.parametrize("address", ["ws://127.0.0.1:9", "listen://127.0.0.1:0"])
def test_a_stream_that_reaches_nobody_fails(cli, address):
    command = ["stream", "-i", str(example()[0]), "--unpaced", "--fps", "10", "--to", address]
    code, _, err = cli(*command)
    assert code == 1
    assert f"{address}: 0 sent, 191 dropped" in err  # 19.1 s: each frame is counted
    assert "no receiver got a frame" in err


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_stopped_while_nothing_comes_it_ends_at_once(number, code):
    command = [*COMMAND, "--input", "-", "--to", "-"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, preexec_fn=heed(signal.SIGINT), text=True, **pipes) as process:
        assert process.stderr.readline().startswith("listening")
        process.send_signal(number)
        assert process.wait(60) == code
        assert "Fatal" not in process.stderr.read()


@pytest.mark.slow
def test_a_stream_whose_frames_have_all_left_is_closed_within_half_a_second():
    fps, frames = 10, []
    session = open_live_session("rules", fps=fps)
    pacer = FramePacer([SimpleNamespace(send=frames.append)], 0.0, paced=False)
    pacer.begin()
    for chunk in Speech.load(example()[0]).window(0, 3).chunks(0.02):
        for motion in session.push(chunk):
            pacer.push(motion)
    frame_count = session.time * fps - session.latency * fps
    until = time.monotonic() + 30
    while len(frames) < int(frame_count) and time.monotonic() < until:
        time.sleep(0.01)
    before = len(frames)
    assert shut_mouth(session, pacer)
    pacer.close()
    assert len(frames) - before == 5
    assert [round(frame.start * fps) for frame in frames] == list(range(len(frames)))


@pytest.mark.slow
def test_a_source_that_fails_shuts_the_mouth():
    fps, frames, notes, now = 30, [], [], [0.0]
    session = open_live_session("rules", fps=fps)
    pacer = FramePacer([SimpleNamespace(send=frames.append)], 0.0, clock=lambda: now[0])

    def pieces():
        for piece in Speech.load(example()[0]).window(0, 3).chunks(0.02):
            yield piece
            now[0] = 1000.0  # all frames are late: none is waited for
        until = time.monotonic() + 30
        while not frames and time.monotonic() < until:
            time.sleep(0.01)
        raise InputError("the cable was pulled", "put it back")

    with pytest.raises(InputError, match="cable"):
        play_to_the_end(session, pieces(), lambda piece: piece, pacer, notes.append)
    assert [round(frame.start * fps) for frame in frames] == list(range(len(frames)))
    assert len(frames) >= 15
    assert frames[-1].face[0, ARKIT_INDEX["jawOpen"]] < 0.05
    assert notes[0].startswith(f"{len(frames)} frames")


@pytest.mark.parametrize("is_paced", [True, False])
def test_the_end_of_the_sound_is_made_in_short_steps(monkeypatch, is_paced):
    """Frames wait until a step is done; steps are short, so that no frame is late by more than a few hundredths."""
    session = open_live_session("rules", look_ahead=0.5, fps=30)
    steps, idle = [], session.idle
    monkeypatch.setattr(session, "idle", lambda seconds: steps.append(seconds) or idle(seconds))
    pacer = SimpleNamespace(paced=is_paced, is_started=True, begin=None, push=lambda motion: None)
    play(session, Speech.load(example()[0]).window(0, 0.5).chunks(0.1), lambda piece: piece, pacer)
    assert steps[0] == 0
    assert sum(steps) == pytest.approx(1.5 if is_paced else 0.0)
    assert max(steps) <= 0.1


@pytest.mark.slow
def test_a_character_listens_to_its_partner(tmp_path):
    """Six seconds of silence on standard input, and speech of a partner: the head moves otherwise than without a partner.

    How much depends on the clock. What a listener does is tested in tests/runtime/test_live_listener.py.
    """
    import soundfile

    speech = Speech.load(example()[0]).window(0, 5.0)
    soundfile.write(tmp_path / "partner.wav", speech.samples, speech.rate)
    silence = np.zeros(6 * 8000, "<i2").tobytes()
    command = [*COMMAND, "-i", "-", "--rate", "8000", "--to", "-", "--fps", "30", "--quiet", "--seed", "3"]
    processes = [
        subprocess.Popen([*command, *more], cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        for more in ([], ["--partner", "partner.wav"])
    ]
    with ThreadPoolExecutor() as pool:  # both at the same time: they play by the clock
        outputs = [output for output, _ in pool.map(lambda process: process.communicate(silence), processes)]
    heads = []
    for output in outputs:
        start, frames, _ = lines(output)
        heads.append(np.array([frame["rotations"][start["joints"].index("head")][0] for frame in frames[:170]]))
    assert len(heads[0]) == len(heads[1]) == 170
    difference = np.degrees(2 * np.abs(heads[1] - heads[0]))
    assert difference[:20].max() < 1, "nothing was said yet"
    assert difference.max() > 0.1


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["-i", "mic", "--partner", "mic"], "--partner and --input are both 'mic'"),
        (["-i", "talk.wav", "--partner", "-", "--control", "-"], "--partner and --control are both '-'"),
        (["-i", "-", "--partner", "vmc://127.0.0.1:39539"], "cannot hear sound from 'vmc://127.0.0.1:39539'"),
        (["-i", "-", "--partner", "mic", "--unpaced"], "--unpaced with --partner"),
        (["-i", "-", "--angle", "20"], "--angle without --partner"),
        (["-i", "-", "--partner", "other.wav", "--angle", "90"], "an angle of 90 degrees"),
        (["-i", "talk.wav", "--partner", "missing.wav"], "'missing.wav'"),
    ],
)
def test_a_partner_that_cannot_be_heard_is_told(cli, given, message, tmp_path, monkeypatch):
    import soundfile

    monkeypatch.chdir(tmp_path)
    for name in ("talk.wav", "other.wav"):
        soundfile.write(name, np.zeros(1000), 16_000)
    code, _, err = cli("stream", *given)
    assert code == 2
    assert message in err
