"""Live sessions of the studio: sound of the page's microphone comes in, frames go to the page and to other receivers.

A session runs in its own threads, so that the server is not blocked. The queues of sound and frames are bounded: a client that
sends too much loses sound, and a receiver that is too slow loses frames.
"""

from __future__ import annotations

import asyncio
import json
import threading
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, cast

from ..audio.live_sources import PIECE, decode_pcm, pace_pieces
from ..audio.waiting_sound import WaitingSound
from ..errors import CospeechError, InputError
from ..export.live.outlets import WAITING, Outlet
from ..export.live.pacing import MARGIN, FramePacer, Pace
from ..export.live.targets import StreamSettings, open_outlet
from ..generate import open_live_session
from ..models import PARTS, load
from ..motion.motion import Motion
from ..runtime.live_controls import LiveControls
from .live_messages import ChangeLive, InterruptLive, LiveStatus, StartLive, TargetStatus
from .motion_bytes import frame_bytes

if TYPE_CHECKING:
    from ..models import Model

__all__ = ["MOST_LIVE", "FrameBox", "LiveModels", "LivePlayer"]

MOST_LIVE = 4
"""Live sessions at the same time [ours: two cores play about so many]."""
_AHEAD = 10.0  # seconds of sound that may wait [ours: more than a browser sends at once]
_SILENCE = 3.0  # seconds of silence after which the rules idle, as in `cospeech stream`


class LiveModels:
    """Models by name, each loaded once."""

    def __init__(self) -> None:
        self._models: dict[str, Model] = {}
        self._lock = threading.Lock()

    def find(self, name: str) -> Model:
        """A model of the catalogue."""
        with self._lock:
            if name not in self._models:
                self._models[name] = load(name)
            return self._models[name]


class FrameBox:
    """A queue of the newest frames from the session to the page, as bytes. It belongs to one event loop.

    Args:
        fps: frames per second; the queue holds as many seconds as that of any other receiver.
    """

    name = "page"

    def __init__(self, fps: float) -> None:
        self._loop, self._change = asyncio.get_running_loop(), asyncio.Event()
        self._frames: deque[bytes] = deque(maxlen=max(1, round(WAITING * fps)))
        self.dropped = 0

    def send(self, frame: Motion) -> None:
        """Queue one frame; called by the thread of the pacing."""
        data = frame_bytes(frame)
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self.put, data)

    def put(self, data: bytes) -> None:
        """Queue the bytes of a frame; if too many wait, the oldest frame is dropped. Called by the loop."""
        self.dropped += len(self._frames) == self._frames.maxlen
        self._frames.append(data)
        self._change.set()

    async def take(self) -> bytes:
        """The next frame."""
        while not self._frames:
            self._change.clear()
            await self._change.wait()
        return self._frames.popleft()


class LivePlayer:
    """Runs one live session.

    Args:
        start: request of the page; its names are checked already.
        models: loads the model.
        box: queue of frames for the page.
        on_end: called once from the thread of the session when it ends, with the problem or None.
    """

    def __init__(
        self, start: StartLive, models: LiveModels, box: FrameBox, on_end: Callable[[CospeechError | None], None]
    ) -> None:
        self._start, self._models, self._box, self._on_end = start, models, box, on_end
        self._sound = WaitingSound(round(_AHEAD * start.rate))
        self._controls = LiveControls(self._sound, self._tell_problem)
        self._notes: dict[str, str] = {}
        self._outlets: list[Outlet] = []
        self._pace = Pace()
        self._latency, self._look_ahead = 0.0, 0.0
        self._stop_event = threading.Event()
        self.problem: CospeechError = InputError("")
        """The last control that was refused."""
        self._thread = threading.Thread(target=self._run, name="cospeech studio live", daemon=True)
        self._thread.start()

    def hear(self, data: bytes) -> None:
        """Add samples of 16 bits; half a sample at the end is left out."""
        self._sound.put(decode_pcm(data[: len(data) - len(data) % 2], "s16"), wait=False)

    def steer(self, message: ChangeLive | InterruptLive) -> None:
        """Change or interrupt the speech before the next piece of sound; an interruption drops the sound that waits."""
        values = message.model_dump(exclude={"type"}, exclude_none=True)
        if isinstance(message, InterruptLive):
            values = {"interrupt": True}
        if values:
            self.problem = InputError("")
            self._controls.put(json.dumps(values))

    def stop(self) -> None:
        """End at once; ``on_end`` follows."""
        self._stop_event.set()
        self._sound.end()

    def status(self, *, running: bool) -> LiveStatus:
        """The present state of the session."""
        targets = [
            TargetStatus(url=outlet.name, sent=outlet.sent, problem=outlet.problem, note=self._notes.get(outlet.name, ""))
            for outlet in self._outlets
        ]
        return LiveStatus(
            running=running, latency=self._latency, look_ahead=self._look_ahead, late=self._pace.late,
            dropped=self._box.dropped, targets=targets, problem=self.problem.problem, hint=self.problem.hint,
        )  # fmt: skip

    def _run(self) -> None:
        """Run the session, in a thread."""
        problem: CospeechError | None = None
        try:
            with ExitStack() as stack:
                self._play(stack)
        except CospeechError as error:
            problem = error
        except Exception as error:
            problem = CospeechError(f"a failure of ours: {type(error).__name__}", str(error)[:200])
        self._stop_event.set()
        self._sound.end()
        self._on_end(problem)

    def _play(self, stack: ExitStack) -> None:
        start = self._start
        session = open_live_session(
            self._models.find(start.model), style=start.style, emotion=start.emotion, intensity=start.intensity, fps=start.fps,
            idle_after=_SILENCE,
        )  # fmt: skip
        session.warm_up()
        self._look_ahead, self._latency = session.look_ahead, session.latency + PIECE + MARGIN
        settings = StreamSettings(start.fps, self._latency, PARTS)
        for address in start.targets:
            outlet = open_outlet(address, settings, lambda text, name=address: self._note(name, text))  # type: ignore[misc]
            stack.callback(outlet.close, 0.5)
            self._outlets.append(outlet)
        pacer = FramePacer([*self._outlets, cast(Outlet, self._box)], self._latency)
        stack.callback(pacer.close, drop=True)
        self._pace = pacer.pace
        for piece in pace_pieces(None, start.rate, waiting=self._sound):
            if self._stop_event.is_set():
                return
            if not pacer.is_started:
                pacer.begin(float(piece.duration))
            for motion in session.push(self._controls.steer(session, piece)):
                pacer.push(motion)

    def _tell_problem(self, problem: InputError) -> None:
        """Keep a problem for the next status; the session goes on."""
        self.problem = problem

    def _note(self, name: str, text: str) -> None:
        """Keep a note of an outlet, such as that a page was refused. Notes about the state of its receiver are not kept: the
        outlet's ``problem`` tells it."""
        if not text.endswith("is back") and all(outlet.problem != text for outlet in self._outlets):
            self._notes[name] = text
