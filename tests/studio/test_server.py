"""The server of local pages: who may ask, how much, how slowly; and that a study gives nothing else away."""

from __future__ import annotations

import json
import socket
import time
from http.client import HTTPConnection

import pytest

pytest.importorskip("starlette", reason="local pages need starlette (the studio extra)")
pytest.importorskip("uvicorn", reason="local pages need uvicorn (the studio extra)")
pytest.importorskip("av", reason="videos need PyAV (the av extra)")

from cospeech.errors import InputError
from cospeech.studio import server
from cospeech.studio.study import load_plan
from cospeech.studio.study.session import make_session
from tests.support.study_raters import ask, encode_answers, make_tiny_study, right_answers, running, serving

SECRET = "keep this to yourself"
PAYLOADS = [
    "../plan.json", "..%2fplan.json", "%2e%2e/plan.json", "%2e%2e%2fplan.json", "..%252fplan.json", "....//plan.json",
    "..\\plan.json", "..%5cplan.json", "%c0%ae%c0%ae/plan.json", "..%c0%afplan.json", "/plan.json", "//plan.json",
    "../../../../../../etc/passwd", "..%2f..%2f..%2f..%2fetc%2fpasswd", "/etc/passwd", "//etc/passwd", "%2fetc%2fpasswd",
    "file:///etc/passwd", "file:%2f%2f%2fetc%2fpasswd", "..;/plan.json", ".%00./plan.json", "plan.json%00.mp4", "plan.json",
    "./plan.json", "~/plan.json", "../answers.sqlite", "..%2fanswers.sqlite", "answers.sqlite", "C:%5cWindows%5cwin.ini",
    "%5c%5chost%5cshare", "..%u2215plan.json", "clips/../../plan.json", "..%ef%bc%8fplan.json", "con", "*", "?", "%",
]  # fmt: skip


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = make_tiny_study(tmp_path_factory.mktemp("study"), 2, 2, title=SECRET)
    (folder.parent / "plan.json").write_text(SECRET)
    return folder


@pytest.fixture(scope="module")
def port(study):
    with serving(study) as port:
        yield port


def raw_get(port: int, path: str) -> bytes:
    """Send a path unchanged; HTTP clients would normalise it."""
    with socket.create_connection(("127.0.0.1", port), timeout=10) as line:
        line.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n".encode())
        got = b""
        while piece := line.recv(65536):
            got += piece
    return got


def test_no_path_reaches_the_file_system(port, study):
    for prefix in ("/clips/", "/", "/api/", "/clips/../"):
        for payload in PAYLOADS:
            if prefix + payload in ("/?", "/clips/../?"):
                continue  # the page itself, with an empty query
            got = raw_get(port, prefix + payload)
            assert got.split(b" ", 2)[1] in (b"400", b"404"), (prefix, payload, got[:200])
            assert not any(word in got for word in (SECRET.encode(), b"root:", b"SQLite", str(study).encode())), payload


def test_the_page_and_its_clips_are_served_and_nothing_from_elsewhere(port, study):
    for path, kind in (
        ("/", "text/html"),
        ("/study.js", "text/javascript"),
        ("/study.css", "text/css"),
        ("/api/study", "application/json"),
    ):
        status, headers, content = ask(port, path)
        assert (status, headers["content-type"].split(";")[0]) == (200, kind)
        assert b"http://" not in content
        assert b"https://" not in content
        assert "default-src 'none'" in headers["content-security-policy"]
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
    clip = load_plan(study).clips[0].file
    status, headers, content = ask(port, f"/clips/{clip}")
    assert (status, headers["content-type"]) == (200, "video/mp4")
    assert content == (study / "clips" / clip).read_bytes()
    assert ask(port, f"/clips/{clip}", range="bytes=0-3")[::2] == (206, content[:4])
    assert ask(port, "/docs")[0] == ask(port, "/openapi.json")[0] == 404


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1", "http://127.0.0.1:1", "https://x", "file://", "]["]
)
def test_a_page_from_elsewhere_may_not_ask(port, origin):
    assert ask(port, "/api/raters", {"consent": True}, origin=origin)[0] in (400, 403)
    assert ask(port, "/api/study", origin=origin)[0] in (400, 403)


def test_who_calls_this_machine_by_another_name_is_refused(port):
    assert ask(port, "/", host="evil.example")[0] == 421
    assert ask(port, "/", host=f"localhost:{port}")[0] == 200
    assert ask(port, "/api/raters", {"consent": True}, sec_fetch_site="cross-site")[0] == 403


@pytest.mark.parametrize("length", ["chunked", "declared", "lied"])
def test_a_large_body_is_refused_at_once(port, length):
    began, size = time.monotonic(), server.MESSAGE_BYTES + 1
    if length == "chunked":
        body = (b"x" * 65536 for _ in range(17))
        connection = HTTPConnection("127.0.0.1", port, timeout=10)
        try:
            connection.request("POST", "/api/answers", body, encode_chunked=True, headers={"transfer-encoding": "chunked"})
            status = connection.getresponse().status
        except (BrokenPipeError, ConnectionResetError):
            status = 413  # the server has answered and hung up while we were still sending
        finally:
            connection.close()
        assert status == 413
    elif length == "declared":
        assert ask(port, "/api/answers", b"", method="POST", content_length=str(size))[0] == 413
    else:
        assert ask(port, "/api/answers", b"", method="POST", content_length="minus one")[0] == 400
    assert time.monotonic() - began < 1
    assert ask(port, "/api/study")[0] == 200


def bad_answers(plan) -> list[object]:
    good = encode_answers(plan, right_answers(plan, make_session(plan, 0)[0]))
    name = next(iter(good))
    wrong = [None, [], 7, {}, {name: None}, {name: "2"}, {name: 99}, {name: 1.0}, {name: True}, {name: [1]}, {name: [[]]}]
    wrong += [{name: {"a": 1}}, {**good, "another": 1}, {"'; DROP TABLE answers; --": 1}, {name: 10**40}]
    return [*({"trial": 0, "answers": answers, "seconds": 1} for answers in wrong)] + [
        {"trial": trial, "answers": good, "seconds": 1} for trial in (-1, 10**9, "0", None, 0.5, True, [])
    ] + [{"trial": 0, "answers": good, "seconds": seconds} for seconds in (-1, "3", None, 1e300, [])]  # fmt: skip


def test_malformed_answers_are_refused(port, study):
    rater = json.loads(ask(port, "/api/raters", {"consent": True})[2])["rater"]
    for body in bad_answers(load_plan(study)):
        status, _, content = ask(port, "/api/answers", body, x_rater=rater)
        assert status == 422, body
        assert "Traceback" not in content.decode()
    for body in (b"{", b"\xff\xfe", b"[" * 100_000, b'"x"', b"NaN", b"[]"):
        assert ask(port, "/api/answers", body, x_rater=rater)[0] == 400
    for name in ("", "x", "' OR 1=1 --", "%00"):
        assert ask(port, "/api/answers", {"trial": 0}, x_rater=name)[0] == 404
        assert ask(port, "/api/session", x_rater=name)[0] == 404
    for body in (
        {},
        {"consent": False},
        {"consent": 1},
        {"consent": True, "participant": 7},
        {"consent": True, "participant": "a\nb"},
        {"consent": True, "participant": "x" * 65},
    ):
        assert ask(port, "/api/raters", body)[0] == 422
    assert json.loads(ask(port, "/api/session", x_rater=rater)[2])["done"] == []
    assert ask(port, "/api/raters", method="DELETE")[0] == 405


def test_a_network_needs_the_token(study):
    token = server.make_token()
    cookie = server.name_cookie(token)
    assert cookie != server.name_cookie(server.make_token())  # another server of this machine
    with serving(study, token=token) as port:
        assert ask(port, "/")[0] == ask(port, "/?token=x")[0] == ask(port, "/api/study", cookie=f"{cookie}=x")[0] == 401
        status, headers, _ = ask(port, f"/?token={token}&participant=abc")
        assert (status, headers["location"]) == (303, "./?participant=abc")
        assert "HttpOnly; SameSite=Strict" in headers["set-cookie"]
        assert ask(port, "/", cookie=f"a=b; {cookie}={token}", host="study.example")[0] == 200
        assert ask(port, "/api/study", authorization=f"Bearer {token}")[0] == 200
        assert ask(port, "/api/raters", {"consent": True}, cookie=f"{cookie}={token}", origin="http://evil.example")[0] == 403


@pytest.mark.slow
def test_a_thousand_connections_that_come_and_go(port):
    for k in range(1000):
        with socket.create_connection(("127.0.0.1", port), timeout=10) as line:
            if k % 3:
                line.sendall(b"GET / HTTP/1.1\r\nHost: 127" if k % 3 == 1 else b"\x00\xff\r\n\r\n")
    until = time.monotonic() + 5
    while (status := ask(port, "/api/study")[0]) == 503 and time.monotonic() < until:  # those who left are still counted
        time.sleep(0.02)
    assert status == 200


def test_slow_clients_stop_nobody_and_are_sent_away(study, monkeypatch):
    monkeypatch.setattr(server, "REQUEST_SECONDS", 0.3)
    with serving(study) as port:
        lines = [socket.create_connection(("127.0.0.1", port), timeout=5) for _ in range(50)]
        for line in lines:
            line.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ")
        began = time.monotonic()
        assert ask(port, "/api/study")[0] == 200
        assert time.monotonic() - began < 0.3
        assert all(line.recv(100) == b"" for line in lines)
        for line in lines:
            line.close()


def test_a_body_that_does_not_come_is_given_up(study):
    async def never(scope, receive, send):
        raise AssertionError("the application is not asked")

    with running(server.Guard(never, seconds=0.1)) as port, socket.create_connection(("127.0.0.1", port), timeout=5) as line:
        line.sendall(f"POST / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: 9\r\n\r\nx".encode())
        assert line.recv(100).startswith(b"HTTP/1.1 408")


def test_a_port_that_is_taken_is_said():
    with server.open_socket("127.0.0.1", 0) as first, pytest.raises(InputError, match="cannot listen"):
        server.open_socket("127.0.0.1", first.getsockname()[1])
    with pytest.raises(InputError, match="cannot listen"):
        server.open_socket("127.0.0.1", 99_999_999)


@pytest.mark.parametrize(
    ("host", "own"),
    [
        ("127.0.0.1", True),
        ("127.9.9.9", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("192.168.1.5", False),
        ("example.org", False),
    ],
)
def test_loopback(host, own):
    assert server.is_loopback(host) is own


def test_a_server_of_a_network_names_an_address_that_other_computers_can_open(monkeypatch):
    with server.open_socket("0.0.0.0", 0) as listening:
        port = listening.getsockname()[1]
        own, other = server.list_addresses("0.0.0.0", listening, "secret")
        assert own == f"http://127.0.0.1:{port}/?token=secret"
        assert "0.0.0.0" not in other
        monkeypatch.setattr(server, "_find_outward", lambda far: None)  # without a network
        assert server.list_addresses("0.0.0.0", listening, "secret")[1] == f"http://{socket.gethostname()}:{port}/?token=secret"
        monkeypatch.setattr(server, "_find_outward", lambda far: "2001:db8::7")
        assert server.list_addresses("::", listening, None) == [f"http://[::1]:{port}/", f"http://[2001:db8::7]:{port}/"]
        assert server.list_addresses("127.0.0.1", listening, None) == [f"http://127.0.0.1:{port}/"]


@pytest.mark.parametrize(("given", "is_asked"), [([], False), (["--token", "auto"], True), (["--host", "0.0.0.0"], True)])
def test_a_studio_asks_other_users_of_the_machine_for_a_token_too(cli, monkeypatch, given, is_asked):
    pytest.importorskip("websockets", reason="the studio needs websockets (the studio extra)")
    tokens = []
    monkeypatch.setattr("cospeech.studio.state.StudioState.start_warm_up", lambda state: None)
    monkeypatch.setattr(
        "cospeech.studio.server.run_server", lambda app, listening, **more: tokens.append(app._token) or listening.close()
    )
    code, out, _ = cli("studio", "--no-browser", "--port", 0, *given)
    assert code == 0
    assert (tokens[0] is not None) is is_asked is ("?token=" in out)
    assert not is_asked or (len(tokens[0]) > 20 and tokens[0] in out)
