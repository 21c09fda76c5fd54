"""Receivers that are slow, absent, dying or hostile do not hold up the others; frames leave in order and at their times."""

from __future__ import annotations

import itertools
import json
import queue
import socket
import threading
import time
from contextlib import ExitStack

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.sync.server import serve

from cospeech.errors import InputError
from cospeech.export.live import receiver, websocket
from cospeech.export.live.addresses import split_address
from cospeech.export.live.json_frames import JsonEncoder
from cospeech.export.live.outlets import Outlet, UdpWire
from cospeech.export.live.pacing import FramePacer
from cospeech.export.live.receiver import open_receiver
from cospeech.export.live.targets import SCHEMES, StreamSettings, open_outlet
from cospeech.export.live.websocket import WebSocketServer, WebSocketWire
from cospeech.motion.skeleton import humanoid
from tests.support.motions import gesturing

SETTINGS = StreamSettings(fps=30, latency=1.5, parts=("face", "body", "hands"))
MOTION = gesturing(20)


def frames():
    return [MOTION[k : k + 1] for k in range(len(MOTION))]


def json_encoder() -> JsonEncoder:
    return JsonEncoder(30, 1.5, humanoid(), face=True)


class Recorder:
    """A wire that keeps what it is given, fails where it is told to, and may be slow."""

    is_refused = False
    is_alone = False
    is_needed = False

    def __init__(self, *, fail_at: tuple[int, ...] = (), refuse: int = 0, seconds: float = 0) -> None:
        self.data: list[bytes] = []
        self.fail_at, self.refuse, self.seconds, self.connects, self.closed = set(fail_at), refuse, seconds, 0, False

    def connect(self) -> None:
        self.connects += 1
        if self.connects <= self.refuse:
            raise ConnectionRefusedError("nobody")

    def send(self, data: bytes) -> None:
        time.sleep(self.seconds)
        if len(self.data) in self.fail_at:
            self.fail_at.discard(len(self.data))
            raise BrokenPipeError("gone")
        self.data.append(data)

    def close(self) -> None:
        self.closed = True


def run(wire, notes: list[str] | None = None) -> Outlet:
    outlet = Outlet("test", json_encoder(), wire, fps=30, note=(notes if notes is not None else []).append)
    for frame in frames():
        outlet.send(frame)
    outlet.close()
    return outlet


def test_all_frames_come_in_order_between_a_start_and_an_end():
    wire = Recorder()
    outlet = run(wire)
    types = [json.loads(data)["type"] for data in wire.data]
    assert types == ["start", *["frame"] * 20, "end"]
    assert [json.loads(data)["frame"] for data in wire.data[1:-1]] == list(range(20))
    assert (outlet.sent, outlet.dropped, wire.closed) == (20, 0, True)


def test_a_receiver_that_goes_is_found_again_and_told_once():
    wire, notes = Recorder(fail_at=(6,)), []
    outlet = run(wire, notes)
    types = [json.loads(data)["type"] for data in wire.data]
    assert types.count("start") == 2  # who comes back has to be told again what the frames hold
    assert outlet.sent == 19
    assert outlet.dropped == 1
    assert [("cannot be reached" in note, "is back" in note) for note in notes] == [(True, False), (False, True)]


@pytest.mark.parametrize("fail_at", [3, 21])  # 21: the text that ends the stream
def test_a_receiver_that_is_needed_and_goes_ends_the_stream(fail_at):
    wire, notes = Recorder(fail_at=(fail_at,)), []
    wire.is_needed = True
    outlet = Outlet("test", json_encoder(), wire, fps=30, note=notes.append)

    def play() -> None:
        for frame in frames():
            outlet.send(frame)
            time.sleep(0.01)
        outlet.close()

    with pytest.raises(BrokenPipeError):
        play()
    assert len(wire.data) == fail_at
    assert notes == []
    outlet.close()  # it is told once


def test_a_receiver_that_is_not_there_is_told_of_once_and_nothing_waits_for_it():
    wire, notes = Recorder(refuse=10**6), []
    began = time.monotonic()
    outlet = run(wire, notes)
    assert time.monotonic() - began < 20
    assert (outlet.sent, len(notes)) == (0, 1)
    assert outlet.dropped >= 1


def test_a_slow_receiver_misses_the_oldest_frames():
    wire = Recorder(seconds=0.02)
    outlet = Outlet("slow", json_encoder(), wire, fps=5, note=print)  # two seconds of frames: 10
    for _ in range(3):
        for frame in frames():
            outlet.send(frame)
    outlet.close(timeout=20)
    assert outlet.dropped > 30
    assert outlet.sent + outlet.dropped == 60
    assert json.loads(wire.data[-2])["frame"] == 19  # the newest came


def test_datagrams_reach_their_port_and_nobody_need_listen():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10)
        outlet = open_outlet(f"livelink://127.0.0.1:{receiver.getsockname()[1]}", SETTINGS, pytest.fail)
        for frame in frames():
            outlet.send(frame)
        outlet.close()
        got = [receiver.recv(65536) for _ in range(20)]
    assert outlet.sent == 20
    assert len(set(got)) == 20


def test_that_nobody_listens_is_told_once():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    notes: list[str] = []
    outlet = Outlet("test", json_encoder(), UdpWire("127.0.0.1", port), fps=30, note=notes.append)
    for frame in frames():
        outlet.send(frame)
        time.sleep(0.005)
    outlet.close()
    assert (outlet.sent, notes) == (20, ["nobody listens at test; frames are sent all the same"])
    assert outlet.problem == notes[0]


def test_a_receiver_that_listens_after_a_while_ends_the_problem():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    outlet = Outlet("test", json_encoder(), UdpWire("127.0.0.1", port), fps=30, note=lambda text: None)
    sending = itertools.cycle(frames())
    until = time.monotonic() + 30
    while not outlet.problem and time.monotonic() < until:
        outlet.send(next(sending))
        time.sleep(0.02)
    assert outlet.problem
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", port))
        while outlet.problem and time.monotonic() < until:
            outlet.send(next(sending))
            time.sleep(0.02)
    assert not outlet.problem
    outlet.close()


def test_frames_that_wait_at_the_end_are_counted():
    outlet = Outlet("test", json_encoder(), Recorder(seconds=0.2), fps=30, note=lambda text: None)
    for frame in frames():
        outlet.send(frame)
    outlet.close(timeout=0.5)
    assert outlet.dropped >= 15
    assert outlet.sent + outlet.dropped == 20


def test_every_client_of_the_server_gets_the_start_and_what_follows():
    wire = WebSocketServer("listen://127.0.0.1:0")
    notes: list[str] = []
    outlet = Outlet("listen", json_encoder(), wire, fps=30, note=notes.append)
    one, two = frames()[:2]
    outlet.send(one)
    until = time.monotonic() + 30
    while not outlet.dropped and time.monotonic() < until:  # nobody is there yet
        time.sleep(0.01)
    with connect(f"ws://127.0.0.1:{wire.port}") as first, connect(f"ws://127.0.0.1:{wire.port}") as second:
        assert {json.loads(c.recv(timeout=30))["type"] for c in (first, second)} == {"start"}
        outlet.send(two)
        assert json.loads(second.recv(timeout=30))["time"] == pytest.approx(1 / 30, abs=1e-5)
        first.close()  # who leaves does not disturb the other
        outlet.send(frames()[2])
        assert json.loads(second.recv(timeout=30))["frame"] == 2
        outlet.close()
        assert json.loads(second.recv(timeout=30))["type"] == "end"
    assert (outlet.sent, outlet.dropped) == (2, 1)
    assert notes == ["nobody is connected to listen; frames are dropped until a client comes"]
    assert not outlet.problem


def test_frames_that_no_client_gets_are_dropped_and_told_once():
    notes: list[str] = []
    outlet = run(WebSocketServer("listen://127.0.0.1:0"), notes)
    assert (outlet.sent, outlet.dropped) == (0, 20)
    assert notes == ["nobody is connected to test; frames are dropped until a client comes"]


def test_pages_of_other_places_cannot_connect_and_are_told_of():
    notes: list[str] = []
    wire = WebSocketServer("listen://127.0.0.1:0", note=notes.append)
    address = f"ws://127.0.0.1:{wire.port}"
    for origin in ("https://evil.example", "http://localhost.evil.example", "null", "https://evil.example"):
        with pytest.raises(InvalidStatus, match="403"), connect(address, origin=origin):
            pass
    with connect(address, origin="http://localhost:5173"), connect(address):
        pass
    wire.close()
    assert [note.split(" was refused")[0] for note in notes] == [
        "a page of 'https://evil.example'", "a page of 'http://localhost.evil.example'", "a file, or a page in a frame,",
    ]  # fmt: skip
    assert notes[-1].endswith("(to let it in: listen://127.0.0.1:0?origin=null)")


def test_pages_of_origins_that_are_named_can_connect():
    wire = WebSocketServer("listen://127.0.0.1:0?origin=null,https://My.example,tauri://localhost,file://")
    address = f"ws://127.0.0.1:{wire.port}"
    for origin in ("null", "https://my.example", "tauri://localhost", "file://", "http://127.0.0.1"):
        with connect(address, origin=origin):
            pass
    with pytest.raises(InvalidStatus), connect(address, origin="https://my.example.evil"):
        pass
    wire.close()


@pytest.mark.parametrize("origin", ["*", "my.example", "https://a/b", "https://a b"])
def test_what_is_no_origin(origin):
    with pytest.raises(InputError, match="origin="):
        WebSocketServer(f"listen://127.0.0.1:0?origin={origin}")


GARBAGE = (b"", b"\0" * 4096, bytes(range(256)) * 40, b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 500, b"GET /\r\n\r\n", b"\r\n" * 99)


def test_peers_that_send_garbage_disturb_nobody():
    wire = WebSocketServer("listen://127.0.0.1:0")
    outlet = Outlet("listen", json_encoder(), wire, fps=30, note=lambda text: None)
    outlet.send(frames()[0])
    hello = b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    request = hello + b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    with connect(f"ws://127.0.0.1:{wire.port}") as good:
        assert json.loads(good.recv(timeout=30))["type"] == "start"
        peers = [socket.create_connection(("127.0.0.1", wire.port), timeout=5) for _ in range(2 * len(GARBAGE))]
        for peer, data in zip(peers, [*GARBAGE, *(request + each for each in GARBAGE)], strict=True):
            peer.sendall(data)
        for frame in frames()[1:]:
            outlet.send(frame)
        got = [json.loads(good.recv(timeout=30))["frame"]]  # the first frame, or the next one, if that was sent before
        while got[-1] < 19:
            got.append(json.loads(good.recv(timeout=30))["frame"])
        assert got == list(range(got[0], 20))
        assert got[0] <= 1
        for peer in peers:
            peer.close()
        outlet.close()
        assert json.loads(good.recv(timeout=30))["type"] == "end"


@pytest.mark.parametrize(
    "answer", [b"", b"\0" * 512, b"HTTP/1.1 200 OK\r\n\r\nhello", b"HTTP/1.1 101 Switching\r\n\r\n" + b"\xff" * 512]
)
def test_a_server_of_theirs_that_answers_garbage_is_told_of_and_holds_up_nothing(answer):
    listening = socket.create_server(("127.0.0.1", 0))

    def reply() -> None:
        while True:
            try:
                peer, _ = listening.accept()
            except OSError:
                return
            with peer:
                peer.recv(4096)
                peer.sendall(answer)

    threading.Thread(target=reply, daemon=True).start()
    notes: list[str] = []
    began = time.monotonic()
    outlet = run(WebSocketWire(f"ws://127.0.0.1:{listening.getsockname()[1]}"), notes)
    listening.close()
    assert outlet.sent == 0
    assert len(notes) == 1
    assert time.monotonic() - began < 10


def test_a_server_of_theirs_is_reached_again_after_it_went():
    got: queue.Queue = queue.Queue()

    def hear(connection) -> None:
        for message in connection:
            got.put(json.loads(message))

    server = serve(hear, "127.0.0.1", 0)
    port = server.socket.getsockname()[1]
    threading.Thread(target=server.serve_forever, daemon=True).start()
    outlet = Outlet("ws", json_encoder(), WebSocketWire(f"ws://127.0.0.1:{port}"), fps=30, note=lambda text: None)
    for frame in frames():
        outlet.send(frame)
    outlet.close()
    server.shutdown()
    messages = [got.get(timeout=30) for _ in range(22)]
    assert [m["type"] for m in messages] == ["start", *["frame"] * 20, "end"]


@pytest.mark.parametrize(
    ("address", "what"),
    [
        ("osc://127.0.0.1:1", "cannot send to"),
        ("vmc", "cannot send to"),
        ("vmc://", "has no host (write vmc://127.0.0.1:39539)"),
        ("livelink://", "has no host (write livelink://127.0.0.1:11111)"),
        ("vmc://127.0.0.1:x", "is no address"),
        ("vmc://127.0.0.1:99999", "is no address"),
        ("vmc://127.0.0.1:0", "has port 0, at which nobody listens (write vmc://127.0.0.1:39539)"),
        ("livelink://127.0.0.1:0", "has port 0"),
        ("ws://127.0.0.1:0", "has port 0"),
        ("vmc://127.0.0.1:39539/path", "has a path '/path' (write vmc://127.0.0.1:39539)"),
        ("listen://127.0.0.1:8765/x", "has a path '/x'"),
        ("vmc://127.0.0.1?face=vrm7", "face='vrm7'"),
        ("vmc://127.0.0.1?packet=9", "packet='9'"),
        ("vmc://127.0.0.1?colour=red", "unknown option 'colour'"),
        ("livelink://127.0.0.1?subject=", "subject=''"),
        ("listen://127.0.0.1", "has no port (write listen://127.0.0.1:8765)"),
        ("ws://", "has no host (write ws://127.0.0.1:8765)"),
        ("ws://127.0.0.1:x", "is no address (write ws://127.0.0.1:8765)"),
    ],
)
def test_addresses_that_cannot_be_used(address, what):
    with pytest.raises(InputError) as error:
        open_outlet(address, SETTINGS, print)
    assert what in str(error.value)


def test_a_port_that_is_taken():
    with socket.create_server(("127.0.0.1", 0)) as server, pytest.raises(InputError, match="cannot listen"):
        open_outlet(f"listen://127.0.0.1:{server.getsockname()[1]}", SETTINGS, print)


def test_every_scheme_has_a_usual_port_or_asks_for_one():
    assert split_address("listen://host:0", None) == ("host", 0, {})
    assert split_address("ws://host/path", 80) == ("host", 80, {})
    assert split_address("vmc://host", 39539) == ("host", 39539, {})
    assert split_address("vmc://[::1]:7?face=vrm1", None, query=("face",)) == ("::1", 7, {"face": "vrm1"})
    assert set(SCHEMES) == {"vmc", "livelink", "ws", "wss", "listen", "-"}


class Clock:
    """A clock that only sleeping moves."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


class FrameLog(list):
    """An outlet that notes when each frame came."""

    def __init__(self, clock) -> None:
        self.clock = clock

    def send(self, frame) -> None:
        self.append((self.clock(), frame.start))


def test_frames_leave_at_their_times_however_they_are_made():
    frame_log = FrameLog(time.monotonic)
    pacer = FramePacer([frame_log], delay=0.2)
    began = time.monotonic()
    pacer.begin()
    for burst in (MOTION[:1], MOTION[1:15], MOTION[15:]):
        pacer.push(burst)
    pace = pacer.close()
    at, start = np.array(frame_log).T
    np.testing.assert_allclose(start, np.arange(20) / 30, atol=1e-9)
    assert (at - began >= start + 0.2 - 1e-3).all()
    assert pace.frames == 20


def test_frames_that_are_late_leave_at_once_and_are_counted():
    clock = Clock()
    frame_log = FrameLog(clock)
    pacer = FramePacer([frame_log], delay=0.0, clock=clock)
    pacer.begin()
    clock.now += 10  # whoever made the frames took ten seconds
    pacer.push(MOTION)
    pace = pacer.close()
    assert (pace.frames, pace.late) == (20, 20)
    assert pace.worst == pytest.approx(10)


def test_an_interrupted_stream_forgets_what_has_not_left():
    frame_log = FrameLog(time.monotonic)
    pacer = FramePacer([frame_log], delay=0.05)
    pacer.begin()
    pacer.push(MOTION)
    pacer.close(drop=True)
    assert len(frame_log) < 20


def test_frames_that_have_not_left_are_taken_back():
    frame_log = FrameLog(time.monotonic)
    pacer = FramePacer([frame_log], delay=0.05)
    pacer.begin()
    pacer.push(MOTION)
    time.sleep(0.2)
    first = pacer.take_back()
    assert first is not None
    assert pacer.take_back() == first
    left = MOTION[round(first * MOTION.fps) :]
    pacer.push(left)
    pacer.close()
    assert len(frame_log) == 20  # each once


def wait_for(pacer, count: int) -> None:
    """Until so many frames have left."""
    until = time.monotonic() + 30
    while pacer.pace.frames < count:
        assert time.monotonic() < until
        time.sleep(0.005)


def test_where_all_frames_have_left_the_next_one_is_told():
    pacer = FramePacer([FrameLog(time.monotonic)], delay=0.0, paced=False)
    assert pacer.take_back() is None  # nobody has seen a frame
    pacer.begin()
    pacer.push(MOTION)
    wait_for(pacer, 20)
    assert pacer.take_back() == pytest.approx(20 / 30)
    pacer.close()


def test_a_first_frame_that_is_about_to_leave_is_not_taken_back():
    clock, asleep = Clock(), threading.Event()
    frame_log = FrameLog(clock)
    pacer = FramePacer([frame_log], delay=0.1, clock=lambda: asleep.set() or clock.now)
    pacer.begin()
    asleep.clear()
    pacer.push(MOTION)
    assert asleep.wait(30)  # the first frame waits for its time
    assert pacer.take_back() == pytest.approx(1 / 30)
    clock.now += 2
    pacer.close()
    assert [start for _, start in frame_log] == [0.0]


class FailingOutlet:
    """An outlet whose second frame is one too many."""

    count = 0

    def send(self, frame) -> None:
        self.count += 1
        if self.count == 2:
            raise ValueError("too much")


def test_an_outlet_that_fails_is_told_to_who_pushes_and_who_closes():
    pacer = FramePacer([FailingOutlet()], delay=0.0, paced=False)
    pacer.begin()
    pacer.push(MOTION)
    pacer._thread.join(30)
    for call in (lambda: pacer.push(MOTION), pacer.close):
        with pytest.raises(ValueError, match="too much"):
            call()


def test_a_server_of_sound_that_goes_without_a_word_ends_the_sound():
    def hear(connection) -> None:
        connection.send(b"one")
        connection.socket.shutdown(socket.SHUT_RDWR)

    with serve(hear, "127.0.0.1", 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with open_receiver(f"ws://127.0.0.1:{server.socket.getsockname()[1]}") as messages:
            assert list(messages) == [b"one"]


def test_a_source_of_another_scheme_is_told():
    with pytest.raises(InputError, match="known: ws://, wss://, listen://"), open_receiver("http://127.0.0.1:1"):
        pass


def test_a_second_client_that_waits_is_told_of_once():
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    notes: list[str] = []
    address, url = f"listen://127.0.0.1:{port}", f"ws://127.0.0.1:{port}"
    with open_receiver(address, notes.append) as messages, connect(url) as first:
        first.send(b"one")
        assert [next(messages), next(messages)] == [b"", b"one"]
        with connect(url) as second, connect(url):
            second.send(b"two")
            until = time.monotonic() + 30
            while not notes and time.monotonic() < until:
                time.sleep(0.01)
        first.close()
        while next(messages) != b"two":  # the third may be heard first; it says nothing
            pass
    assert notes == [f"a second client waits at {address} until the first one has gone"]


def test_a_flood_of_clients_is_cut_off_and_one_that_says_nothing_does_not_hold_up_the_end(monkeypatch):
    """The library has two threads for each client, and waits 10 s for one that does not say what it wants."""
    monkeypatch.setattr(websocket, "MOST_CLIENTS", 2)
    monkeypatch.setattr(websocket, "_PATIENCE", 0.2)
    wire = WebSocketServer("listen://127.0.0.1:0")
    wire.send(b'{"type": "start"}')
    with connect(f"ws://127.0.0.1:{wire.port}") as good, socket.create_connection(("127.0.0.1", wire.port)):
        with socket.create_connection(("127.0.0.1", wire.port), timeout=3) as third:
            assert third.recv(1) == b"", "it is cut off"
        assert good.recv(timeout=10) == '{"type": "start"}'
        began = time.monotonic()
        wire.close()
        assert time.monotonic() - began < 5


def test_messages_that_nobody_takes_do_not_hold_up_the_end(monkeypatch):
    monkeypatch.setattr(websocket, "_PATIENCE", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with ExitStack() as stack:
        stack.enter_context(open_receiver(f"listen://127.0.0.1:{port}"))
        with connect(f"ws://127.0.0.1:{port}", close_timeout=0.2) as client:
            for _ in range(receiver._MESSAGES + 5):
                client.send(b"00")
            end = threading.Thread(target=stack.pop_all().close, daemon=True)
            end.start()
            end.join(10)
            assert not end.is_alive()
