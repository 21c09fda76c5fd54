"""The WebSockets of the studio's page: events of takes, and live sessions."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Coroutine
from functools import partial
from importlib import import_module
from typing import Any

from pydantic import TypeAdapter, ValidationError

from ..errors import CospeechError, InputError
from .catalogue import check_emotion, check_style, find_model
from .events import Listener
from .live import MOST_LIVE, FrameBox, LivePlayer
from .live_messages import ChangeLive, InterruptLive, LiveMessage, LiveStatus, StartLive
from .messages import TakeEvent
from .server import load_web
from .state import StudioState

__all__ = ["StudioSockets"]

_STATUS_SECONDS = 1.0  # between two states of a live session; ours
_LOST = 1006  # code of a connection that ended without a word (RFC 6455)
_BEHIND = 1013  # code of a close: try again later (RFC 6455, IANA's registry)
_LIVE: TypeAdapter[Any] = TypeAdapter(LiveMessage)


class StudioSockets:
    """The endpoints.

    Args:
        state: of the server.
    """

    def __init__(self, state: StudioState) -> None:
        self._state = state

    async def events(self, socket: Any) -> None:
        """``WS /api/events``: first the last event of each take, then all new events."""
        listener, page, end = Listener(), socket.query_params.get("page", "")[:64], _Ending()
        await socket.accept()
        self._state.hub.add(listener)
        self._state.pages.enter(page)
        try:
            for take in self._state.takes.things:
                await socket.send_text(take.event.model_dump_json())
            await _until_first(_send_events(socket, listener), end.wait(socket))
        finally:
            self._state.hub.remove(listener)
            self._state.pages.close(page, end.code)

    async def live(self, socket: Any) -> None:
        """``WS /api/live``: one live session at a time."""
        await socket.accept()
        client = _LiveClient(self._state, socket)
        try:
            await client.serve()
        finally:
            await client.close()


async def _until_first(*works: Coroutine[Any, Any, None]) -> None:
    """Run several coroutines until one has ended; the others are cancelled. That a client has disconnected is no error."""
    tasks = [asyncio.create_task(work) for work in works]
    try:
        first_tasks, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in first_tasks:
        if task.exception() is not None and not isinstance(task.exception(), _client_errors()):
            raise task.exception()  # type: ignore[misc]


def _client_errors() -> tuple[type[BaseException], ...]:
    """Exceptions that mean that a client has disconnected."""
    return load_web("starlette.websockets").WebSocketDisconnect, RuntimeError, OSError


async def _send_events(socket: Any, listener: Listener) -> None:
    while not listener.is_behind:
        event: TakeEvent = await listener.take()
        await socket.send_text(event.model_dump_json())
    await socket.close(_BEHIND)


class _Ending:
    """The close code of a connection."""

    def __init__(self) -> None:
        self.code = _LOST

    async def wait(self, socket: Any) -> None:
        """Wait until the client has closed the connection."""
        while (message := await socket.receive())["type"] != "websocket.disconnect":
            pass
        self.code = message.get("code") or _LOST


class _LiveClient:
    """One connection of a page with a live session."""

    def __init__(self, state: StudioState, socket: Any) -> None:
        self._state, self._socket = state, socket
        self._player: LivePlayer | None = None
        self._sending: asyncio.Task[None] | None = None
        self._end_event = asyncio.Event()

    async def serve(self) -> None:
        """Handle the messages of the page until it disconnects."""
        with contextlib.suppress(*_client_errors()):
            while (message := await self._socket.receive())["type"] != "websocket.disconnect":
                data = message.get("bytes")
                if data is None:
                    await self._obey(message.get("text") or "")
                elif self._player is not None:
                    self._player.hear(data)

    async def _obey(self, text: str) -> None:
        try:
            message = _LIVE.validate_json(text)
            if isinstance(message, StartLive):
                await self._start(message)
            elif isinstance(message, ChangeLive | InterruptLive):
                self._steer(message)
            else:
                await self.close()
        except ValidationError as error:
            first = error.errors(include_url=False, include_input=False)[0]
            await self._tell_problem(f"{'.'.join(map(str, first['loc']))}: {first['msg']}"[:300], "see docs/guides/studio.md")
        except CospeechError as error:
            await self._tell_problem(error.problem, error.hint)

    async def _start(self, start: StartLive) -> None:
        await self.close()
        catalogue = await import_module("anyio.to_thread").run_sync(self._state.list_catalogue)
        self._model = find_model(catalogue, start.model)
        check_style(self._model, start.style)
        check_emotion(start.emotion)
        for address in start.targets:
            if address == "-":
                raise InputError("standard output belongs to the server", "vmc://, livelink://, ws:// or listen://")
        if self._state.live_sessions >= MOST_LIVE:
            raise InputError(f"{MOST_LIVE} live sessions run already", "stop one of them")
        self._state.live_sessions += 1
        box, self._end_event = FrameBox(start.fps), asyncio.Event()
        self._player = LivePlayer(start, self._state.live_models, box, partial(self._on_end, asyncio.get_running_loop()))
        self._sending = asyncio.create_task(self._send(self._player, box))

    def _on_end(self, loop: asyncio.AbstractEventLoop, problem: CospeechError | None) -> None:
        """Called by the thread of the session."""
        with contextlib.suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(self._end, problem)

    def _end(self, problem: CospeechError | None) -> None:
        self._state.live_sessions -= 1
        if problem is not None and self._player is not None:
            self._player.problem = problem
        self._end_event.set()

    def _steer(self, change: ChangeLive | InterruptLive) -> None:
        if self._player is None:
            raise InputError("no live session runs", 'send {"type": "start", …} first')
        if isinstance(change, ChangeLive):
            check_style(self._model, change.style)
            check_emotion(change.emotion or "auto")
        self._player.steer(change)

    async def _send(self, player: LivePlayer, box: FrameBox) -> None:
        """Send frames and states of a session until it ends."""
        with contextlib.suppress(*_client_errors()):
            await _until_first(self._send_frames(box), self._send_states(player), _wait_for(self._end_event))
            if self._end_event.is_set():
                await self._socket.send_text(player.status(running=False).model_dump_json())

    async def _send_frames(self, box: FrameBox) -> None:
        while True:
            await self._socket.send_bytes(await box.take())

    async def _send_states(self, player: LivePlayer) -> None:
        while True:
            await self._socket.send_text(player.status(running=True).model_dump_json())
            await asyncio.sleep(_STATUS_SECONDS)

    async def _tell_problem(self, problem: str, hint: str) -> None:
        running = self._player is not None and not self._end_event.is_set()
        if running and self._player is not None:
            status = self._player.status(running=True)
        else:
            status = LiveStatus(running=False, latency=0, look_ahead=0, late=0, dropped=0, targets=[])
        await self._socket.send_text(status.model_copy(update={"problem": problem, "hint": hint}).model_dump_json())

    async def close(self) -> None:
        """End the session, if one runs, and tell the page."""
        player, sending, self._player, self._sending = self._player, self._sending, None, None
        if player is not None and sending is not None:
            player.stop()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(sending, 5)


async def _wait_for(event: asyncio.Event) -> None:
    await event.wait()
