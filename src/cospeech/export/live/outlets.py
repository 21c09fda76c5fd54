"""Send frames while they are made: one thread for each receiver, so that none can delay the others or the session."""

from __future__ import annotations

import errno
import os
import socket
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import IO, Protocol

from ...errors import is_broken_pipe
from ...motion.motion import Motion

__all__ = ["Encoder", "LineWire", "Outlet", "UdpWire", "Wire"]

WAITING = 2.0  # seconds of frames that a slow receiver may be behind; then the oldest are dropped (ours)
_RETRY = (0.25, 4.0)  # seconds between two attempts to connect: the first, and the longest (ours)
_REFUSAL_LASTS = 2.0  # seconds for which a refusal counts (ours: machines send one or more a second)


class Encoder(Protocol):
    """Frames of motion → what a receiver takes."""

    def begin(self) -> bytes:
        """Bytes before the first frame of a connection; empty: nothing is sent."""

    def end(self) -> bytes:
        """Bytes after the last frame."""

    def frames(self, motion: Motion) -> Iterator[list[bytes]]: ...


class Wire(Protocol):
    """How bytes reach a receiver."""

    @property
    def is_refused(self) -> bool:
        """Whether its machine says that nobody listens there. Bytes are sent all the same."""

    is_alone: bool
    """Whether what was sent last reached nobody, because no client is connected."""
    is_needed: bool
    """Whether the stream ends without this receiver; any other is tried again."""

    def connect(self) -> None:
        """Raises OSError where there is nobody."""

    def send(self, data: bytes) -> None:
        """Raises OSError where the receiver has gone."""

    def close(self) -> None: ...


class UdpWire:
    """Sends datagrams, which nobody has to receive."""

    def __init__(self, host: str, port: int) -> None:
        self._address, self._socket = (host, port), None
        self._refusal: float | None = None  # when a datagram was last refused

    _socket: socket.socket | None
    is_alone = False
    is_needed = False

    @property
    def is_refused(self) -> bool:
        """See `Wire`."""
        return self._refusal is not None and time.monotonic() - self._refusal < _REFUSAL_LASTS

    def connect(self) -> None:
        """See `Wire`; looks up the name of the host. Of several addresses, such as those of localhost, IPv4's is taken:
        receivers of these protocols listen there, and the other address would give no error if nobody listens.
        """
        addresses = socket.getaddrinfo(*self._address, type=socket.SOCK_DGRAM)
        family, kind, protocol, _, address = min(addresses, key=lambda each: each[0] != socket.AF_INET)
        self._socket = socket.socket(family, kind, protocol)
        self._socket.connect(address)

    def send(self, data: bytes) -> None:
        """See `Wire`."""
        assert self._socket is not None
        try:
            self._socket.send(data)
        except (ConnectionRefusedError, ConnectionResetError):  # of an earlier datagram; the latter on Windows
            self._refusal = time.monotonic()

    def close(self) -> None:
        """See `Wire`."""
        if self._socket is not None:
            self._socket.close()


class LineWire:
    """Writes lines to standard output, or to another binary file."""

    is_refused = False
    is_alone = False
    is_needed = True

    def __init__(self, file: IO[bytes] | None = None) -> None:
        self._file = file if file is not None else sys.stdout.buffer

    def connect(self) -> None:
        """See `Wire`."""

    def send(self, data: bytes) -> None:
        """See `Wire`."""
        try:
            self._file.write(data + b"\n")
            self._file.flush()
        except OSError as error:
            if is_broken_pipe(error):
                raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE)) from None
            raise

    def close(self) -> None:
        """See `Wire`."""


class Outlet:
    """Sends frames to one receiver, in a thread.

    Args:
        name: for messages.
        encoder: of its format.
        wire: to it.
        fps: of the motion.
        note: called when the receiver goes, and when it is back.

    Attributes:
        sent, dropped: numbers of frames.
        problem: why nobody receives frames now, in words; empty where they are received.
    """

    def __init__(self, name: str, encoder: Encoder, wire: Wire, *, fps: float, note: Callable[[str], None]) -> None:
        self.name, self.sent, self.dropped, self.problem = name, 0, 0, ""
        self._encoder, self._wire, self._note = encoder, wire, note
        self._waiting: deque[Motion] = deque()
        self._most = max(1, round(WAITING * fps))
        self._condition, self._over, self._in_hand = threading.Condition(), False, False
        self._error: OSError | None = None
        self._thread = threading.Thread(target=self._work, name=f"cospeech {name}", daemon=True)
        self._thread.start()

    def send(self, frame: Motion) -> None:
        """Queue one frame; returns at once. Raises OSError, once, if the receiver is needed and has gone."""
        self._raise_error()
        with self._condition:
            if len(self._waiting) >= self._most:
                self._waiting.popleft()
                self.dropped += 1
            self._waiting.append(frame)
            self._condition.notify()

    def close(self, timeout: float = 2.0) -> None:
        """Send what waits, and end; a receiver that takes longer than ``timeout`` seconds does not get it. Raises as `send`."""
        with self._condition:
            self._over = True
            self._condition.notify()
        self._thread.join(timeout)
        with self._condition:
            self.dropped += len(self._waiting) + self._in_hand  # a frame in hand is given up, too
            self._waiting.clear()
            self._in_hand = False
        self._wire.close()
        self._raise_error()

    def _raise_error(self) -> None:
        error, self._error = self._error, None
        if error is not None:
            raise error

    def _next(self) -> Motion | None:
        with self._condition:
            while not self._waiting and not self._over:
                self._condition.wait()
            self._in_hand = bool(self._waiting)
            return self._waiting.popleft() if self._waiting else None

    def _count(self, *, is_sent: bool) -> None:
        with self._condition:
            self.sent += is_sent and self._in_hand
            self.dropped += not is_sent and self._in_hand
            self._in_hand = False

    def _fault(self) -> str:
        """Why perhaps nobody got the frame, in words; empty where it is received."""
        if self._wire.is_refused:
            return f"nobody listens at {self.name}; frames are sent all the same"
        return f"nobody is connected to {self.name}; frames are dropped until a client comes" if self._wire.is_alone else ""

    def _work(self) -> None:
        is_connected, has_warned, wait, notes = False, False, _RETRY[0], set[str]()
        while (frame := self._next()) is not None:
            try:
                if not is_connected:
                    self._wire.connect()
                    if first := self._encoder.begin():
                        self._wire.send(first)
                    if has_warned:
                        self._note(f"{self.name} is back")
                    is_connected, has_warned, wait = True, False, _RETRY[0]
                for packets in self._encoder.frames(frame):
                    for data in packets:
                        self._wire.send(data)
                self._count(is_sent=not self._wire.is_alone)
                self.problem = self._fault()
                if self.problem and self.problem not in notes:
                    notes.add(self.problem)
                    self._note(self.problem)
            except OSError as error:
                self._count(is_sent=False)
                if self._wire.is_needed:
                    self._error = error
                    return
                is_connected = False
                self.problem = f"{self.name} cannot be reached ({error.strerror or error}); trying again"
                if not has_warned:
                    has_warned = True
                    self._note(self.problem)
                with self._condition:
                    self._condition.wait_for(lambda: self._over, wait)
                wait = min(2 * wait, _RETRY[1])
        if is_connected and (last := self._encoder.end()):
            try:
                self._wire.send(last)
            except OSError as error:
                self._error = error if self._wire.is_needed else None
