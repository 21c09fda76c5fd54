"""Receivers by their address: ``vmc://``, ``livelink://``, ``ws://``, ``listen://``, and ``-`` for standard output."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ...errors import InputError
from ...motion.skeleton import humanoid
from ..avatar import load_avatar
from . import live_link, vmc
from .addresses import scheme_of, split_address, unknown_address
from .json_frames import JsonEncoder
from .live_link import LiveLinkEncoder
from .outlets import Encoder, LineWire, Outlet, UdpWire, Wire
from .vmc import VmcEncoder, avatar_offsets
from .websocket import WebSocketServer, WebSocketWire

__all__ = ["SCHEMES", "StreamSettings", "open_outlet"]

_PACKET = range(200, 65_001)  # bytes of a datagram that a user may set: one bone must fit (ours)

Note = Callable[[str], None]


@dataclass(frozen=True)
class StreamSettings:
    """The facts about a stream that the encoders need."""

    fps: float
    latency: float
    """Seconds by which a frame leaves after its sound."""
    parts: tuple[str, ...]
    avatar: Path | None = None
    """The character whose bones the receivers of bones have."""
    bone_map: Mapping[str, str] | None = None
    """Our name → name of a joint of the avatar, where its joints are not recognised."""


def open_outlet(address: str, settings: StreamSettings, note: Note) -> Outlet:
    """Open the receiver at an address. It is connected when the first frame comes, and again whenever the connection is lost.

    Raises:
        InputError: no such scheme, a part of the address that is missing or unknown, or a port that is taken.
    """
    scheme = "-" if address == "-" else scheme_of(address)
    if scheme not in SCHEMES:
        raise unknown_address(f"cannot send to {address!r}", SCHEMES)
    encoder, wire = SCHEMES[scheme](address, settings, note)
    return Outlet(address, encoder, wire, fps=settings.fps, note=note)


def _vmc(address: str, settings: StreamSettings, note: Note) -> tuple[Encoder, Wire]:
    host, port, options = split_address(address, vmc.PORT, query=("face", "packet"))
    face, packet = options.get("face", vmc.FACES[0]), options.get("packet", str(_PACKET[-1]))
    if face not in vmc.FACES:
        raise InputError(f"face={face!r} in {address!r}", f"known: {', '.join(vmc.FACES)}")
    if not packet.isdecimal() or int(packet) not in _PACKET:
        raise InputError(f"packet={packet!r} in {address!r}", f"bytes, {_PACKET[0]} … {_PACKET[-1]}; 1400 fits into Ethernet's")
    if settings.avatar is None:
        return VmcEncoder(face=face, most=int(packet)), UdpWire(host, port)
    avatar = load_avatar(settings.avatar, settings.bone_map)
    own = {"rest": avatar_offsets(avatar), "still_eyes": avatar.eyes_by_shapes}
    return VmcEncoder(face=face, most=int(packet), **own), UdpWire(host, port)  # type: ignore[arg-type]


def _live_link(address: str, settings: StreamSettings, note: Note) -> tuple[Encoder, Wire]:
    host, port, options = split_address(address, live_link.PORT, query=("subject",))
    subject = options.get("subject", "cospeech")
    if not subject or len(subject.encode()) > 255:
        raise InputError(f"subject={subject[:40]!r} in {address[:80]!r}", "a name of 1 … 255 bytes")
    return LiveLinkEncoder(subject), UdpWire(host, port)


def _json(settings: StreamSettings) -> JsonEncoder:
    return JsonEncoder(settings.fps, settings.latency, humanoid(), face="face" in settings.parts)


def _websocket(address: str, settings: StreamSettings, note: Note) -> tuple[Encoder, Wire]:
    split_address(address.split("?")[0], 443 if scheme_of(address) == "wss" else 80)
    return _json(settings), WebSocketWire(address)


def _listen(address: str, settings: StreamSettings, note: Note) -> tuple[Encoder, Wire]:
    return _json(settings), WebSocketServer(address, note=note)


SCHEMES: dict[str, Callable[[str, StreamSettings, Note], tuple[Encoder, Wire]]] = {
    "vmc": _vmc, "livelink": _live_link, "ws": _websocket, "wss": _websocket, "listen": _listen,
    "-": lambda address, settings, note: (_json(settings), LineWire()),
}  # fmt: skip
"""Scheme → the function that opens a receiver of that kind."""
