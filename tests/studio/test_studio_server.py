"""The studio's server: what it makes is right, and nobody can break out of it, fill it or stop it."""

from __future__ import annotations

import asyncio
import http.client
import io
import json
import os
import signal
import socket
import struct
import time
import wave

import numpy as np
import pytest

pytest.importorskip("starlette", reason="local pages need starlette (the studio extra)")
pytest.importorskip("uvicorn", reason="local pages need uvicorn (the studio extra)")
pytest.importorskip("websockets", reason="the studio needs websockets (the studio extra)")

from websockets.exceptions import ConnectionClosed, InvalidStatus

from cospeech import Motion, Plan
from cospeech.audio.languages import LANGUAGES, check_language
from cospeech.audio.waiting_sound import WaitingSound
from cospeech.errors import InputError
from cospeech.export import FORMATS
from cospeech.generate import generate_files
from cospeech.motion.skeletons.arkit import ARKIT
from cospeech.studio.catalogue import check_style, make_catalogue
from cospeech.studio.live import FrameBox
from cospeech.studio.messages import ModelRow
from cospeech.studio.motion_bytes import read_motion
from cospeech.studio.server import open_socket
from cospeech.studio.speeches import label_of
from cospeech.studio.uploads import UPLOAD_BYTES, UploadRefused, Uploads
from tests.studio.test_server import PAYLOADS, raw_get
from tests.support.studio_server import ask_json, list_files, open_websocket, studio, wait_for
from tests.support.study_raters import ask

RULES = ModelRow(
    name="rules", title="", styles=["natural", "calm"], seated=[], parts=["face"], takes_gestures=True, takes_example=False,
    latency=1,
)  # fmt: skip


def sound_file(seconds: float = 2.0, rate: int = 16_000) -> bytes:
    """A voice-like hum as WAV."""
    times = np.arange(round(seconds * rate)) / rate
    samples = np.sin(2 * np.pi * 140 * times) * (0.5 + 0.5 * np.sin(2 * np.pi * 4 * times)) * 0.5
    buffer = io.BytesIO()
    with wave.open(buffer, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes((samples * 32767).astype("<i2").tobytes())
    return buffer.getvalue()


@pytest.fixture(scope="module")
def server():
    with studio() as (port, state):
        yield port, state


@pytest.fixture(scope="module")
def speech(server):
    port, _ = server
    return ask_json(port, "/api/speech?name=hum.wav", sound_file())


@pytest.fixture(scope="module")
def take(server, speech):
    port, state = server
    key = ask_json(port, "/api/takes", {"speech": speech["speech"], "model": "rules", "seed": 3})["take"]
    assert wait_for(state, key).type == "done"
    return key


# what it makes --------------------------------------------------------------------------------------------------------


def test_a_speech_is_told_and_heard(server, speech):
    port, _ = server
    assert (speech["name"], speech["seconds"], len(speech["peaks"])) == ("hum.wav", 2.0, 100)
    assert 0.4 < max(speech["peaks"]) <= 0.51
    path = f"/api/speech/{speech['speech']}/sound"
    status, headers, sound = ask(port, path)
    assert (status, headers["content-type"]) == (200, "audio/wav")
    with wave.open(io.BytesIO(sound)) as file:
        assert file.getnframes() / file.getframerate() == 2.0
    assert ask(port, path, range="bytes=4-7")[::2] == (206, sound[4:8])
    words = ask_json(port, f"/api/speech/{speech['speech']}/transcript?name=a.tsv", b"0.2\t0.9\thuge\n", method="PUT")
    assert words == {"words": [{"text": "huge", "start": 0.2, "end": 0.9, "language": None}], "language": ""}


def test_the_waveform_of_minutes_is_as_fine_as_that_of_seconds(server):
    port, _ = server
    assert len(ask_json(port, "/api/speech?name=long.wav", sound_file(125, 8000))["peaks"]) == 50 * 125


def set_language(port: int, speech: str, code: str) -> tuple[int, dict]:
    """Set the language of the words of a speech: status, answer."""
    status, _, body = ask(port, f"/api/speech/{speech}/language", {"language": code}, method="PUT")
    return status, json.loads(body)


def test_the_language_of_the_words_is_found_or_set_with_the_errors_of_the_command(server):
    port, _ = server
    name = ask_json(port, "/api/speech?name=hum.wav", sound_file())["speech"]
    transcript = f"/api/speech/{name}/transcript?name=a.tsv"
    for code, has_words in (("de", False), ("xx", True), ("german", True)):
        if has_words:
            ask_json(port, transcript, b"0.2\t0.5\tja\n", method="PUT")
        with pytest.raises(InputError) as of_command:
            check_language(code, has_words=has_words)
        status, answer = set_language(port, name, code)
        assert (status, answer["problem"], answer["hint"]) == (422, of_command.value.problem, of_command.value.hint)
    assert set_language(port, name, "de-AT")[1]["language"] == "de"
    french = "0.1\t0.4\tle\n0.4\t0.6\tchat\n0.6\t0.8\test\n0.8\t1.0\tdans\n1.0\t1.2\tla\n1.2\t1.5\tmaison\n"
    later = ask_json(port, transcript, french.encode(), method="PUT")
    assert (later["language"], {word["language"] for word in later["words"]}) == ("de", {"de"})
    status, answer = set_language(port, name, "")
    assert (status, answer["language"], {word["language"] for word in answer["words"]}) == (200, "fr", {"fr"})


@pytest.mark.slow
def test_a_take_in_a_language_has_the_face_that_generate_makes(server, tmp_path):
    port, state = server
    name = ask_json(port, "/api/speech?name=hum.wav", sound_file())["speech"]
    words = tmp_path / "words.tsv"
    words.write_text("0.2\t0.6\twill\n0.6\t1.2\tvier\n")
    ask_json(port, f"/api/speech/{name}/transcript?name=words.tsv", words.read_bytes(), method="PUT")
    assert set_language(port, name, "de")[0] == 200
    take = ask_json(port, "/api/takes", {"speech": name, "model": "rules"})["take"]
    assert wait_for(state, take).type == "done"
    report = ask_json(port, f"/api/takes/{take}/report")
    assert (report["language"], report["language_source"]) == ("de", "given")
    (tmp_path / "hum.wav").write_bytes(sound_file())
    for code in ("de", "en"):
        generate_files(tmp_path / "hum.wav", [tmp_path / f"{code}.csv"], transcript=words, language=code)
    face = ask(port, f"/api/takes/{take}/file?suffix=.csv")[2]
    assert face == (tmp_path / "de.csv").read_bytes()
    assert face != (tmp_path / "en.csv").read_bytes()


@pytest.mark.slow
def test_a_take_is_what_generate_makes_and_downloads_are_read_by_our_readers(server, speech, take, tmp_path):
    port, state = server
    data = ask(port, f"/api/takes/{take}/motion")[2]
    (length,) = struct.unpack_from("<I", data)
    header = json.loads(data[4 : 4 + length])
    assert (header["frames"], header["fps"], len(header["joints"]), len(header["weights"])) == (60, 30, 55, 52)
    assert len(data) == 4 + length + 4 * 60 * (3 + 55 * 4 + 52)
    sound, words = tmp_path / "hum.wav", tmp_path / "words.tsv"
    sound.write_bytes(sound_file())
    result = state.takes.find(take)
    words.write_text("".join(f"{start}\t{end}\t{text}\n" for text, start, end, _ in result.job["words"]))
    transcript = words if result.job["words"] else None
    generate_files(sound, [tmp_path / "talk.bvh", tmp_path / "talk.glb"], transcript=transcript, seed=3)
    for suffix in (".bvh", ".glb"):
        status, headers, content = ask(port, f"/api/takes/{take}/file?suffix={suffix}")
        assert status == 200
        assert headers["content-disposition"] == f'attachment; filename="hum{suffix}"'
        (tmp_path / f"got{suffix}").write_bytes(content)
        got, expected = (Motion.load(tmp_path / f"{name}{suffix}") for name in ("got", "talk"))
        np.testing.assert_allclose(got.rotations, expected.rotations, atol=1e-6)
        np.testing.assert_allclose(got.root, expected.root, atol=1e-6)
    assert (tmp_path / "got.bvh").read_bytes() == (tmp_path / "talk.bvh").read_bytes()
    for suffix in (".vrma", ".csv", ".json", ".npz"):
        path = tmp_path / f"got{suffix}"
        path.write_bytes(ask(port, f"/api/takes/{take}/file?suffix={suffix}")[2])
        assert FORMATS[suffix].readable
        assert len(Motion.load(path)) == 60
    assert len(read_motion(result.motion)) == 60
    assert ask_json(port, f"/api/takes/{take}/report")["frames"] == 60
    plan = ask_json(port, f"/api/takes/{take}/plan")
    again = ask_json(port, "/api/takes", {"speech": speech["speech"], "model": "rules", "plan": plan})["take"]
    assert wait_for(state, again).type == "done"
    assert ask(port, f"/api/takes/{again}/motion")[2] == data


@pytest.mark.slow
def test_a_file_that_holds_nothing_of_what_the_model_makes_is_refused(server, speech):
    port, state = server
    take = ask_json(port, "/api/takes", {"speech": speech["speech"], "model": "speech-to-face"})["take"]
    assert wait_for(state, take).type == "done"
    status, _, body = ask(port, f"/api/takes/{take}/file?suffix=.bvh")
    problem = "'hum.bvh' would not move: the take has face only, .bvh files hold body and hands"
    assert (status, json.loads(body)["problem"]) == (422, problem)
    assert ask(port, f"/api/takes/{take}/file?suffix=.csv")[0] == 200


@pytest.mark.slow
def test_trained_models_make_takes_by_name_by_mixture_and_by_example(server, speech):
    port, state = server
    longer = ask_json(port, "/api/speech?name=longer.wav", sound_file(8))
    first = ask_json(port, "/api/takes", {"speech": longer["speech"], "model": "rules"})["take"]
    assert wait_for(state, first).type == "done"
    clip = ask_json(port, "/api/clips?name=other.bvh", ask(port, f"/api/takes/{first}/file?suffix=.bvh")[2])
    assert clip["seconds"] == 8.0
    motions = {}
    for row in ask_json(port, "/api/catalogue")["models"]:
        if row["takes_gestures"]:
            continue
        request = {"speech": speech["speech"], "model": row["name"], "parts": row["parts"]}
        styles = [None] if not row["styles"] else [{"name": row["styles"][-1]}, {"mix": dict.fromkeys(row["styles"][:2], 0.5)}]
        styles += [{"clip": clip["clip"]}] if row["takes_example"] else []
        for k, style in enumerate(styles):
            key = ask_json(port, "/api/takes", {**request, "style": style})["take"]
            event = wait_for(state, key)
            assert event.type == "done", (row["name"], style, event.problem, event.hint)
            motions[row["name"], k] = ask(port, f"/api/takes/{key}/motion")[2]
            report = ask_json(port, f"/api/takes/{key}/report")
            assert (report["model"], report["frames"]) == (row["name"], 60)
            assert (report["style"] == "example") == (style is not None and "clip" in style)
    assert len({name for name, _ in motions}) == 4
    assert len(set(motions.values())) == len(motions)


@pytest.mark.slow
def test_the_catalogue_and_the_mannequin(server):
    port, _ = server
    catalogue = ask_json(port, "/api/catalogue")
    assert catalogue["default_model"] == "rules"
    assert catalogue["languages"] == LANGUAGES
    assert {row["name"] for row in catalogue["models"]} >= {"rules", "mix-stage", "stylised-flow"}
    assert all(row["styles"] and row["latency"] > 0 for row in catalogue["models"])
    assert len(catalogue["joints"]) == len(catalogue["parents"]) == len(catalogue["rest"]) == 55
    assert ask(port, "/api/mannequin")[2][:4] == b"glTF"


EDITS = [
    ({"kind": "add", "form": "big", "at": 4.0}, lambda plan: plan.add("big", at=4.0)),
    ({"kind": "add", "form": "point", "word": "there", "size": 1.3}, lambda plan: plan.add("point", word="there", size=1.3)),
    ({"kind": "remove", "gesture": "a1"}, lambda plan: plan.remove("a1")),
    ({"kind": "move", "gesture": "a1", "to": 3.0}, lambda plan: plan.move("a1", 3.0)),
    ({"kind": "change", "gesture": "a1", "size": 0.5}, lambda plan: plan.change("a1", size=0.5)),
    (
        {"kind": "change", "gesture": "a1", "hands": None, "form": "toss"},
        lambda plan: plan.change("a1", hands=None, form="toss"),
    ),
    ({"kind": "reseed", "start": 1.0, "end": 3.0}, lambda plan: plan.reseed(1.0, 3.0)),
    ({"kind": "set", "start": 1.0, "end": 3.0, "style": "calm"}, lambda plan: plan.set(1.0, 3.0, style="calm")),
    ({"kind": "lock", "start": 1.0, "end": 3.0}, lambda plan: plan.lock(1.0, 3.0)),
    (
        {"kind": "clear", "start": 1.0, "end": 3.0, "names": ["emotion", "style"]},
        lambda plan: plan.clear(1.0, 3.0, ["emotion", "style"]),
    ),
    ({"kind": "unlock"}, lambda plan: plan.unlock()),
]


@pytest.mark.parametrize(("edit", "same"), EDITS)
def test_every_edit_is_that_of_the_plan(server, edit, same):
    port, _ = server
    plan = Plan.model_validate({"words": [{"text": "there", "start": 1.0, "end": 1.5}]}).add("huge", at=2.0)
    message = plan.model_dump(mode="json", by_alias=True)
    answer = ask_json(port, "/api/plans/edit", {"plan": message, "edit": edit})
    assert Plan.model_validate(answer["plan"]) == same(plan)


def test_a_plan_from_a_file_is_one_of_the_speech_and_the_model(server):
    port, _ = server
    speech = ask_json(port, "/api/speech?name=hum.wav", sound_file())["speech"]
    ask_json(port, f"/api/speech/{speech}/transcript?name=a.tsv", b"0.2\t0.9\thuge\n", method="PUT")
    plan = Plan.model_validate({"seconds": 2.0}).add("huge", at=1.0).model_dump(mode="json", by_alias=True)
    request = {"plan": plan, "speech": speech, "model": "rules"}
    answer = ask_json(port, "/api/plans/open", request)
    assert Plan.model_validate(answer["plan"]) == Plan.model_validate(plan)
    assert answer["note"] == ""
    words = plan | {"words": [{"text": "tiny", "start": 0.2, "end": 0.9}]}
    assert "words" in ask_json(port, "/api/plans/open", request | {"plan": words})["note"]
    for wrong, problem in (
        ({"plan": plan | {"seconds": 9.0}}, "a speech of 9 s, and this one has 2 s"),
        ({"plan": plan | {"style": "x"}}, "style: rules has no style"),
        ({"model": "stylised-flow"}, "takes none"),
    ):
        status, _, content = ask(port, "/api/plans/open", request | wrong)
        assert status == 422
        assert problem in json.loads(content)["problem"]


WRONG = {"id": "a", "form": "x", "stroke": 1.0}


@pytest.mark.parametrize(
    ("path", "body", "entry"),
    [
        ("plans/edit", {"plan": {"cospeech_plan": 1, "gestures": [WRONG]}, "edit": {"kind": "unlock"}}, "gestures[0].form"),
        ("plans/edit", {"plan": {"cospeech_plan": 1}, "edit": {"kind": "explode"}}, "edit"),
        ("plans/edit", {"plan": {}, "edit": {"kind": "unlock"}}, None),
        ("takes", {"speech": "x", "model": "rules", "intensity": 9}, "intensity"),
        ("takes", {"speech": "x", "model": "rules", "fps": 1e9}, "fps"),
        ("takes", b"[" * 100_000, None),
        ("takes", b"\xff\xfe{", None),
        ("takes", [], None),
    ],
)  # fmt: skip
def test_a_wrong_message_is_told_with_its_entry(server, path, body, entry):
    status, _, content = ask(server[0], f"/api/{path}", body)
    answer = json.loads(content)
    assert status == 422
    assert answer["problem"]
    assert answer["entry"] == entry


# paths ----------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_no_path_reaches_the_file_system(server, speech, take):
    port, state = server
    before = list_files(state.place)
    for prefix in ("/", "/assets/", "/api/speech/", "/api/takes/", "/api/clips/"):
        for payload in PAYLOADS:
            for suffix in ("", "/motion", "/sound"):
                if prefix == "/" and payload == "?":
                    continue  # the page itself, with an empty query
                got = raw_get(port, prefix + payload + suffix)
                assert got.split(b" ", 2)[1] in (b"400", b"404", b"405"), (prefix, payload, got[:200])
                assert b"root:" not in got
                assert str(state.place).encode() not in got
    base = {"speech": speech["speech"], "model": "rules"}
    status, *_, answer = ask(port, "/api/takes", base | {"speech": "0" * 16})
    assert status == 404
    assert json.loads(answer)["problem"] == "this speech is no longer here"
    for payload in PAYLOADS:
        name = payload + ".bvh"
        bad = [{"style": {"name": name}}, {"style": {"clip": name[:60]}}, {"style": {"mix": {name: 1}}}, {"model": name}]
        bad += [{"speech": payload[:60]}, {"emotion": payload + ".csv"}]
        bad += [{"plan": {"cospeech_plan": 1, "style": name}}]
        bad += [{"plan": {"cospeech_plan": 1, "stretches": [{"from": 0.0, "to": 1.0, "style": name}]}}]
        for more in bad:
            assert ask(port, "/api/takes", base | more)[0] in (404, 422), more
        for query in (f"suffix={payload}", f"suffix=.bvh/../../{payload}"):
            got = raw_get(port, f"/api/takes/{take}/file?{query}".replace(" ", "%20"))
            assert got.split(b" ", 2)[1] in (b"400", b"422"), query
    assert list_files(state.place) == before


def test_a_name_of_a_file_is_a_label_alone(server):
    port, state = server
    for name in ("..%2f..%2f..%2ftmp%2fowned.wav", "%00", "a%0d%0aset-cookie:%20x", "%2e%2e", "%E2%80%AEvaw.exe"):
        answer = ask_json(port, f"/api/speech?name={name}", sound_file(0.2))
        assert "/" not in answer["name"]
        assert answer["name"].isprintable()
        assert all(path.endswith(("upload", "sound.wav")) for path in list_files(state.place / "speeches"))
    assert label_of("C:\\a\\b.wav", "") == "b.wav"


@pytest.mark.parametrize("style", ["../clip.bvh", "natural:1,/etc/passwd:0", "calm:0.5,clip.glb", "", "hand_height:0.9"])
def test_a_style_is_a_name_of_the_model(style):
    with pytest.raises(InputError, match="no style"):
        check_style(RULES, style)
    check_style(RULES, "natural:0.3, calm:0.7")


# uploads --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["/api/speech?name=a.wav", "/api/clips?name=a.bvh"])
@pytest.mark.parametrize("body", [b"", b"no sound", b"RIFF\xff\xff\xff\xffWAVEfmt ", b"HIERARCHY\nROOT x\n{" * 50, bytes(5000)])
def test_malformed_files_are_refused_and_leave_nothing(server, path, body):
    port, state = server
    before = list_files(state.place)
    status, _, content = ask(port, path, body)
    assert status == 422
    assert str(state.place) not in content.decode()
    assert list_files(state.place) == before


@pytest.mark.parametrize("length", [str(UPLOAD_BYTES + 1), "9" * 30, "minus one"])
def test_a_large_file_is_refused_before_it_is_read(server, length):
    began = time.monotonic()
    assert ask(server[0], "/api/speech", b"", content_length=length)[0] in (400, 413)
    assert time.monotonic() - began < 1


def test_a_file_that_is_shorter_than_it_says_leaves_nothing(server):
    port, state = server
    before = list_files(state.place)
    with socket.create_connection(("127.0.0.1", port), timeout=30) as line:
        line.sendall(f"POST /api/speech HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: 90000\r\n\r\nRIFF".encode())
        until = time.monotonic() + 30
        while list_files(state.place) == before and time.monotonic() < until:
            time.sleep(0.01)
        assert list_files(state.place) != before
    until = time.monotonic() + 30
    while list_files(state.place) != before and time.monotonic() < until:
        time.sleep(0.02)
    assert list_files(state.place) == before


def test_a_long_speech_is_refused(server, monkeypatch):
    monkeypatch.setattr("cospeech.studio.speeches.MINUTES", 0.02)
    status, _, content = ask(server[0], "/api/speech", sound_file(2))
    assert status == 422
    assert "minutes" in json.loads(content)["problem"]


def receive(pieces, tmp_path, *, length=None, uploads=None):
    """The result of an upload: its bytes, or the status of its refusal."""

    async def send():
        for piece in pieces:
            if isinstance(piece, float):
                await asyncio.sleep(piece)
            else:
                yield piece

    try:
        return asyncio.run((uploads or Uploads()).receive(send(), length, tmp_path / "file"))
    except UploadRefused as refusal:
        assert not (tmp_path / "file").exists()
        return refusal.status


def test_limits_of_uploads(tmp_path, monkeypatch):
    assert receive([b"ab", b"c"], tmp_path) == 3
    assert receive([b"a", 0.5, b"b"], tmp_path, uploads=Uploads(grace=0.05)) == 408
    assert receive([b"a", *[0.02, b"b"] * 20], tmp_path, uploads=Uploads(grace=0.1)) == 408
    monkeypatch.setattr("cospeech.studio.uploads.UPLOAD_BYTES", 10)
    assert receive([b"123456", b"78901"], tmp_path) == 413
    monkeypatch.setattr("cospeech.studio.uploads.MOST_UPLOADS", 5)
    assert receive([b"123456"], tmp_path) == 503


# who may ask ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["/api/events", "/api/live"])
@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", None])
def test_a_page_from_elsewhere_gets_no_socket(server, path, origin):
    with pytest.raises(InvalidStatus), open_websocket(server[0], path, origin=origin):
        pass


def test_hosts_origins_and_policies(server):
    port, _ = server
    assert ask(port, "/api/takes", {}, origin="http://evil.example")[0] == 403
    assert ask(port, "/api/catalogue", host="evil.example")[0] == 421
    headers = ask(port, "/")[1]
    policy = headers["content-security-policy"]
    assert f"connect-src 'self' blob: data: ws://127.0.0.1:{port};" in policy
    assert "unsafe" not in policy
    assert headers["permissions-policy"] == "camera=(), geolocation=(), microphone=(self)"
    answer = raw_get(port, "/ HTTP/1.1\r\nHost: localhost;evil\r\nX:")
    assert b"evil" not in answer.partition(b"\r\n\r\n")[0]


def test_without_the_token_nothing_is_served():
    with studio(token="secrettoken") as (port, _):
        assert ask(port, "/api/plans/edit", {})[0] == 401
        with pytest.raises(InvalidStatus), open_websocket(port, "/api/events"):
            pass
        status, headers, _ = ask(port, "/?token=secrettoken")
        assert (status, headers["location"]) == (303, "./")
        cookie = headers["set-cookie"].partition(";")[0]
        assert ask(port, "/", cookie=cookie)[0] == 200
        with open_websocket(port, "/api/events", additional_headers={"cookie": cookie}):
            pass


# load and faults ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["/api/events", "/api/live"])
def test_a_message_over_a_mebibyte_ends_its_connection_alone(server, path):
    port, _ = server
    with open_websocket(port, path) as one, open_websocket(port, path) as other:
        one.send(b"x" * ((1 << 20) + 1))
        with pytest.raises(ConnectionClosed):
            list(one)
        other.ping().wait(30)
    assert ask(port, "/")[0] == 200


@pytest.mark.slow
def test_a_thousand_connections_come_and_go(server):
    port, state = server
    for _ in range(900):
        socket.create_connection(("127.0.0.1", port), timeout=30).close()
    for _ in range(100):
        with open_websocket(port, "/api/events", close_timeout=5):
            pass
    until = time.monotonic() + 30
    while state.hub._listeners and time.monotonic() < until:
        time.sleep(0.02)
    assert not state.hub._listeners
    assert ask(port, "/")[0] == 200


def test_fifty_slow_uploads_stop_nobody(server):
    port, state = server
    head = f"POST /api/speech HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: {UPLOAD_BYTES}\r\n\r\nRIFF".encode()
    lines = [socket.create_connection(("127.0.0.1", port), timeout=30) for _ in range(50)]
    try:
        for line in lines:
            line.sendall(head)
        began = time.monotonic()
        assert ask(port, "/")[0] == 200
        assert time.monotonic() - began < 1
        assert state.uploads._bytes <= 50 * 4
    finally:
        for line in lines:
            line.close()


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_its_take_alone(server):
    port, state = server
    speech = ask_json(port, "/api/speech?name=hum.wav", sound_file())  # that of the module may have gone for newer ones
    body = {"speech": speech["speech"], "model": "chain-of-generation"}
    long = ask_json(port, "/api/speech?name=long.wav", sound_file(60))["speech"]
    first = ask_json(port, "/api/takes", body | {"speech": long})["take"]
    second = ask_json(port, "/api/takes", body | {"model": "rules"})["take"]
    until = time.monotonic() + 30
    while (state.takes.find(first) is not state.queue._running or not state.maker._running) and time.monotonic() < until:
        time.sleep(0.01)
    os.kill(state.maker.process_id, signal.SIGKILL)
    event = wait_for(state, first)
    assert (event.type, event.problem[:28]) == ("error", "the worker process has ended")
    assert wait_for(state, second).type == "done"


@pytest.mark.slow
def test_cancelling_is_told_and_ends_the_work(server):
    port, state = server
    long = ask_json(port, "/api/speech?name=long.wav", sound_file(120))["speech"]
    takes = [ask_json(port, "/api/takes", {"speech": long, "model": "rules"})["take"] for _ in range(2)]
    until = time.monotonic() + 30
    while not state.maker._running and time.monotonic() < until:
        time.sleep(0.01)
    with open_websocket(port, "/api/events") as events:
        for name in (takes[1], takes[0]):  # one that waits, and the one that is made
            began = time.monotonic()
            assert ask(port, f"/api/takes/{name}", method="DELETE")[0] == 204
            assert ask(port, f"/api/takes/{name}", method="DELETE")[0] in (204, 404)  # a page that leaves cancels once more
            while (event := json.loads(events.recv(timeout=30)))["type"] != "cancelled" or event["take"] != name:
                pass
    while state.maker._running and time.monotonic() < began + 10:  # 1.5 s at most on an idle machine
        time.sleep(0.01)
    assert not state.maker._running
    until = time.monotonic() + 30
    while any((state.place / "takes" / name).exists() for name in takes) and time.monotonic() < until:
        time.sleep(0.01)
    assert not any((state.place / "takes" / name).exists() for name in takes)
    short = ask_json(port, "/api/speech?name=hum.wav", sound_file())["speech"]
    key = ask_json(port, "/api/takes", {"speech": short, "model": "rules"})["take"]
    assert wait_for(state, key).type == "done"  # the queue goes on


@pytest.mark.slow
@pytest.mark.parametrize("code", [1001, 1006])
def test_takes_of_a_page_that_has_left_are_cancelled(server, code, monkeypatch):
    port, state = server
    monkeypatch.setattr(state.pages, "_grace", 0.5)
    long = ask_json(port, "/api/speech?name=long.wav", sound_file(900, 8000))["speech"]
    body = {"speech": long, "model": "rules"}
    with open_websocket(port, "/api/events?page=other"), open_websocket(port, "/api/events?page=mine") as mine:
        takes = [ask_json(port, "/api/takes", body | {"page": "mine"})["take"] for _ in range(2)]
        others = [ask_json(port, "/api/takes", body | {"page": page})["take"] for page in ("other", None)]
        time.sleep(1)  # twice the grace: while the page is there, its takes are made
        assert all(state.takes.find(name).in_use for name in (*takes, *others))
        if code == 1001:
            mine.close(code)
        else:
            mine.socket.shutdown(socket.SHUT_RDWR)
        until = time.monotonic() + 30
        while any((state.place / "takes" / name).exists() for name in takes) and time.monotonic() < until:
            time.sleep(0.01)
        assert not any((state.place / "takes" / name).exists() for name in takes)
        assert all((state.place / "takes" / name).exists() for name in others)  # they wait, are made, or are done by now
        for name in others:
            assert ask(port, f"/api/takes/{name}", method="DELETE")[0] == 204
        late = ask_json(port, "/api/takes", body | {"page": "mine"})["take"]  # asked for while it left
        until = time.monotonic() + 30
        while (state.place / "takes" / late).exists() and time.monotonic() < until:
            time.sleep(0.01)
        assert not (state.place / "takes" / late).exists()


def test_a_file_is_written_no_longer_than_its_client_waits(server):
    port, state = server
    long = ask_json(port, "/api/speech?name=long.wav", sound_file(40))["speech"]
    key = ask_json(port, "/api/takes", {"speech": long, "model": "rules", "parts": ["face"]})["take"]
    assert wait_for(state, key).type == "done"
    clients = [http.client.HTTPConnection("127.0.0.1", port) for _ in range(2)]  # one that runs, and one that waits
    for client, suffix in zip(clients, (".mp4", ".gif"), strict=True):
        client.request("GET", f"/api/takes/{key}/file?suffix={suffix}")
    until = time.monotonic() + 30
    while state.file_jobs < 2 and time.monotonic() < until:
        time.sleep(0.01)
    assert state.file_jobs == 2
    for client in clients:
        client.close()
    began = time.monotonic()
    while state.file_jobs and time.monotonic() < began + 8:  # 40 seconds of video take half a minute
        time.sleep(0.01)
    assert state.file_jobs == 0
    assert list_files(state.place / "takes" / key) == ["motion.bin", "plan.json", "report.json"]
    assert ask(port, f"/api/takes/{key}/file?suffix=.csv")[0] == 200  # a process that was killed is started again


def test_too_many_takes_are_refused(server, monkeypatch):
    port, state = server
    speech = ask_json(port, "/api/speech?name=hum.wav", sound_file())
    monkeypatch.setattr("cospeech.studio.takes.MOST_WAITING", 0)
    before = list_files(state.place)
    assert ask(port, "/api/takes", {"speech": speech["speech"], "model": "rules"})[0] == 429
    assert not set(list_files(state.place)) - set(before)  # what other tests have asked for may go meanwhile


# live -----------------------------------------------------------------------------------------------------------------


def test_who_sends_or_takes_too_much_loses_sound_or_frames():
    sound = WaitingSound(1000)
    for k in range(50):
        sound.put(np.full(100, k, np.float32), wait=False)
    assert [int(sound.take(0.0)[0]) for _ in range(10)] == list(range(40, 50))
    assert sound.take(0.0) is None
    sound.put(np.arange(1500, dtype=np.float32), wait=False)
    np.testing.assert_array_equal(sound.take(0.0), np.arange(500, 1500))

    async def slow():
        frames = FrameBox(30)
        for k in range(100):
            frames.put(bytes([k]))
        return frames.dropped, await frames.take()

    assert asyncio.run(slow()) == (40, bytes([40]))


@pytest.mark.slow
def test_a_live_session_sends_frames_and_is_steered(server):
    port, state = server
    start = {"type": "start", "model": "rules", "rate": 16_000, "fps": 20, "targets": ["vmc://127.0.0.1:9"]}
    with open_websocket(port, "/api/live") as line:
        line.send(json.dumps({"type": "change", "intensity": 1}))
        assert "no live session" in json.loads(line.recv(timeout=30))["problem"]
        for wrong in ({"model": "/tmp/x.cospeech"}, {"style": "x.bvh"}, {"emotion": "x.csv"}, {"targets": ["-"]}):
            line.send(json.dumps(start | wrong))
            assert json.loads(line.recv(timeout=30))["problem"]
        line.send(json.dumps(start))
        line.send(np.zeros(16_000, "<i2").tobytes())
        frames, until = [], time.monotonic() + 30
        while len(frames) < 5 and time.monotonic() < until:
            got = line.recv(timeout=30)
            frames += [got] if isinstance(got, bytes) else []
        assert {len(frame) for frame in frames} == {8 + 4 * (3 + 55 * 4 + 52)}
        times = [struct.unpack_from("<d", frame)[0] for frame in frames]
        np.testing.assert_allclose(np.diff(times), 1 / 20, atol=1e-6)
        line.send(json.dumps({"type": "stop"}))
        last = {}
        while last.get("running", True):
            got = line.recv(timeout=30)
            last = last if isinstance(got, bytes) else json.loads(got)
        assert last["targets"][0]["url"] == "vmc://127.0.0.1:9"
        assert last["latency"] > 1
    assert state.live_sessions == 0


@pytest.mark.slow
def test_an_interruption_drops_the_sound_that_was_sent_ahead(server):
    jaw, rate = 8 + 4 * (3 + 55 * 4 + ARKIT.index("jawOpen")), 16_000
    loud = np.random.default_rng(0).normal(0, 3000, 8 * rate) * (1 + np.sin(np.arange(8 * rate) / rate * 20))
    with open_websocket(server[0], "/api/live") as line:
        line.send(json.dumps({"type": "start", "model": "rules", "rate": rate, "fps": 20}))
        line.send(np.clip(loud, -32000, 32000).astype("<i2").tobytes())

        def mouths(seconds):
            values = []
            while len(values) < 20 * seconds:
                got = line.recv(timeout=30)
                values += [struct.unpack_from("<f", got, jaw)[0]] if isinstance(got, bytes) else []
            return values

        assert max(mouths(1)) > 0.05
        line.send(json.dumps({"type": "interrupt"}))
        mouths(2)  # the latency, and the mouth that shuts
        assert max(mouths(1.5)) < 0.02


@pytest.mark.slow
def test_a_receiver_that_comes_later_is_no_problem_any_more(server):
    from websockets.sync.client import connect

    with open_socket("127.0.0.1", 0) as free:
        target = f"127.0.0.1:{free.getsockname()[1]}"
    with open_websocket(server[0], "/api/live") as line:
        line.send(json.dumps({"type": "start", "model": "rules", "rate": 16_000, "targets": [f"listen://{target}"]}))

        def wait_for_target(is_so):
            until = time.monotonic() + 30
            while time.monotonic() < until:
                line.send(np.zeros(1600, "<i2").tobytes())
                got = line.recv(timeout=30)
                for each in [] if isinstance(got, bytes) else json.loads(got)["targets"]:
                    if is_so(each):
                        return each
            pytest.fail("no such status")

        assert "nobody is connected" in wait_for_target(lambda each: each["problem"])["problem"]
        with pytest.raises(InvalidStatus), connect(f"ws://{target}", origin="https://elsewhere.example"):
            pass
        with connect(f"ws://{target}") as client:
            event = wait_for_target(lambda each: each["sent"] > 20 and not each["problem"])
            assert "elsewhere.example" in event["note"]
            client.recv(timeout=30)
        assert wait_for_target(lambda each: each["problem"])


def test_the_catalogue_holds_every_form():
    catalogue = make_catalogue([RULES.model_dump()])
    assert {"beat", "big", "point"} <= {row.name for row in catalogue.forms}
    assert next(row for row in catalogue.forms if row.name == "big").words
    assert catalogue.emotions[0] == "auto"
