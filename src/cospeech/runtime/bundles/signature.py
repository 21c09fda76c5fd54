"""What a network takes and gives: the part of a bundle's manifest from which the runtime chooses how to play it.

A bundle has one network or several, each with a signature. Their names say what they are for:

    make      windows of speech → windows of poses
    live      a frame of speech and a state → a frame of poses and the next state
    style     a stretch of poses → the style that it shows
    classify  speech → logits of speakers and emotions

A system whose motion is drawn has more, which `cospeech.runtime.samplers` runs; ``make`` then turns what is drawn into poses:

    hear      windows of speech → what is heard of it, a step for some frames
    prior     a step of what is heard, and codes that are drawn → logits of the codes that are not, and the next state
    denoise   what is heard, and latents with noise → their velocity

and the names of the ports say what they hold (`PORTS`). A network has the ports that it needs and no others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from ...errors import InputError

__all__ = ["NETWORKS", "PORTS", "STYLE_FRAMES", "Port", "Signature"]

Port = tuple[int | str, ...]
"""Shape of an array: whole numbers, ``"N"`` for the takes, ``"T"`` for the frames of a window, ``"S"`` for its steps, each of
``multiple`` frames."""
STYLE_FRAMES = 64  # frames of an example of a style at least: six halvings by Mix-StAGE's encoder leave one
PORTS = {
    "rows": "standardised features of speech, then style controls, then what stands for the word; one speech for all takes",
    "style": "weights of the speakers, then of the emotions where the network takes them; or a style code",
    "noise": "noise that makes takes differ: on the logits of modes, or of any use (`Signature.normal_noise`); zeros for the "
    "most likely take",
    "face": "ARKit weights of a face that is given, and how far it is given, 0 … 1",
    "seed": "standardised poses before the first new frame, and 1 where one is given; where each take (N) has its own, every "
    "window after the first begins with the last poses of the window before",
    "poses": "standardised poses",
    "logits": "logits of the speakers, then of the emotions; or of the codes of each group",
    "heard": "what a sampler hears of the speech",
    "latent": "what is drawn: latents, with noise or without; or codes, 1 at the place of the one that is drawn of each group",
    "level": "how much noise there is: cosines, then sines of 1, 2 … times its angle",
    "velocity": "velocity of latents with noise",
    "before": "codes of the step before, zeros before the first",
    "codes": "codes of this step, zeros of groups that are not drawn yet",
}
"""Port → what it holds."""
NETWORKS = {
    "make": ({"rows", "style", "noise", "face", "seed", "latent"}, {"poses"}),
    "live": ({"rows", "style", "noise"}, {"poses"}),
    "style": ({"poses"}, {"style"}),
    "classify": ({"rows"}, {"logits"}),
    "hear": ({"rows"}, {"heard"}),
    "prior": ({"heard", "style", "before", "codes"}, {"logits"}),
    "denoise": ({"heard", "style", "latent", "level"}, {"velocity"}),
}
"""Network → inputs that it may have, and outputs that it has."""
_COMMON = {"rows", "face", "heard", "level"}  # one for all takes
_STEPS = {"heard", "latent", "level", "velocity"}  # of steps, not of frames
_BY_STEP = {"live", "prior"}  # networks that take a frame or a step at a time
_ONE_OR_ALL = ("poses", "seed")  # one for all takes, or each take its own
_WIDEST = {"rows": 5024, "style": 1024, "noise": 256, "face": 53, "seed": 2001, "poses": 2000, "logits": 1024}
_WIDEST |= dict.fromkeys(("logits", "heard", "latent", "velocity", "before", "codes"), 1 << 14) | {"level": 256}
_WIDEST_STATE = 1 << 17  # numbers; the last 34 frames of 1,000 channels are a quarter of it
_RANGES = {
    "window": (1, 4096), "look_ahead": (0, 64), "multiple": (1, 1024), "reach": (0, 1 << 16), "hop": (1, 4096),
    "seeds": (0, 64), "groups": (1, 64), "steps": (0, 4096),
}  # fmt: skip
"""Sane sizes (ours): a bundle beyond is damaged or hostile."""
_MOST_STATES = 256  # ours
_HINT = "is the bundle damaged?"


@dataclass(frozen=True)
class Signature:
    """Ports of a network, its window and its look-ahead.

    Raises:
        InputError: sizes that no network of ours can have.

    >>> Signature({"rows": (1, "T", 24)}, {"poses": (1, "T", 57)}, window=32, reach=8).width("poses")
    57
    """

    inputs: Mapping[str, Port]
    outputs: Mapping[str, Port]
    state: Mapping[str, Port] = field(default_factory=dict)
    """What the network remembers from frame to frame, zeros before the first; the output ``next.NAME`` is the next one."""
    window: int | None = None
    """Frames of a window in training; None: the network takes a frame at a time."""
    look_ahead: int = 0
    """Frames of speech after a pose's own that the network waits for, or hears after the new frames of a window."""
    multiple: int = 1
    """Every number of frames has to be a multiple of this."""
    reach: int | None = None
    """Frames to either side of a frame beyond which speech does not matter to it; None: all of a window matters, as it does to
    a network that normalises over the frames, or runs over them both ways."""
    hop: int | None = None
    """New frames of each window where the network fixes them, and ``look_ahead`` with them; None: the player chooses."""
    seeds: int = 0
    """Frames of the port ``seed`` that may be given."""
    groups: int = 1
    """Groups of codes of a step, of each of which one is drawn."""
    steps: int = 0
    """Steps in which noise is taken away."""
    normal_noise: bool = False
    """Whether ``noise`` is of a normal distribution in training; else of a Gumbel distribution, as for logits of modes."""

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if (value is None and name in ("window", "reach", "hop")) or (type(value) is int and low <= value <= high):
                continue
            raise InputError(f"the signature of a network has {name} = {str(value)[:60]}", f"a whole number, {low} … {high}")
        if not isinstance(self.normal_noise, bool):
            raise InputError(f"the signature of a network has normal_noise = {str(self.normal_noise)[:60]}", "true or false")
        if self.state and self.window is not None:
            raise InputError("a network has a window and a state", "a network of windows keeps no state; leave one of them out")
        if self.hop is not None and not (self.window is not None and self.hop + self.look_ahead <= self.window):
            raise InputError(
                f"hop {self.hop} and look_ahead {self.look_ahead} exceed the window of {self.window} frames", _HINT
            )

    @classmethod
    def parse(cls, role: str, value: object) -> Signature:
        """Read the signature of the network ``role`` from a manifest.

        Raises:
            InputError: it is none, of an unknown role, or absurd.
        """
        names = {f.name for f in fields(cls)}
        if role not in NETWORKS or not isinstance(value, dict) or not {"inputs", "outputs"} <= set(value) <= names:
            raise InputError(f"network {role[:40]!r} has no valid signature", f"names of networks: {', '.join(NETWORKS)}")
        ports = {key: _ports(value.get(key, {})) for key in ("inputs", "outputs", "state")}
        signature = cls(**{**value, **ports})
        signature.check(role)
        return signature

    def check(self, role: str) -> None:
        """Refuse ports that a network of this name cannot have.

        Raises:
            InputError: they are not.
        """
        able, due = NETWORKS[role]
        if not (due - {"style"} if role != "style" else due) <= set(self.outputs) <= due or not set(self.inputs) <= able:
            ports = ", ".join([*self.inputs, *self.outputs])[:80]
            raise InputError(
                f"network {role!r} cannot have the ports {ports}", "docs/add_a_model.md lists those that it can have"
            )
        if not set(self.inputs) & {"rows", "poses", "heard", "latent"} or (self.window is None) != (role in _BY_STEP):
            raise InputError(
                f"network {role!r} has window={self.window}",
                "live and prior have none; each other network has one, and hears rows or poses",
            )
        for name, port in {**self.inputs, **self.outputs}.items():
            frames: Port = ("S",) if name in _STEPS or role == "denoise" else ("T",)
            frames = () if role in _BY_STEP or (role, name) == ("style", "style") else frames
            takes = [1] if role in ("style", "classify") or name in _COMMON else [1, "N"] if name in _ONE_OR_ALL else ["N"]
            width = port[-1] if port else 0
            if port not in [(first, *frames, width) for first in takes] or type(width) is not int or width > _WIDEST[name]:
                raise InputError(
                    f"port {name!r} of network {role!r} has the shape {str(port)[:60]}", "docs/add_a_model.md lists the shapes"
                )
        for name, port in self.state.items():
            fits = len(port) == 2 and port[0] in (1, "N") and type(port[1]) is int and port[1] <= _WIDEST_STATE
            if not fits or name in self.inputs or len(self.state) > _MOST_STATES:
                raise InputError(f"state {name[:40]!r} has the shape {str(port)[:60]}", f"(N or 1, at most {_WIDEST_STATE:,})")

    def to_dict(self) -> dict[str, Any]:
        """The signature as a manifest holds it; defaults are left out."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        ports = {key: {name: list(port) for name, port in values[key].items()} for key in ("inputs", "outputs", "state")}
        plain = {f.name: values[f.name] for f in fields(self)[3:] if values[f.name] != f.default}
        return {**{key: value for key, value in ports.items() if value or key != "state"}, **plain}

    def width(self, name: str) -> int:
        """Numbers of a port; 0 where there is none of this name."""
        port = self.inputs.get(name) or self.outputs.get(name) or self.state.get(name) or (0,)
        return int(port[-1])

    @property
    def feeds_back(self) -> bool:
        """Whether each window begins with the last poses that the one before made."""
        return self.inputs.get("seed", (1,))[0] == "N"

    @property
    def probe(self) -> int:
        """Frames that can be made: the window, filled up to the multiple."""
        return -(-(self.window or 1) // self.multiple) * self.multiple


def _ports(value: object) -> dict[str, Port]:
    """Name → shape, out of a manifest.

    Raises:
        InputError: they are none.
    """
    if not isinstance(value, dict):
        raise InputError(f"the ports of a network are {str(value)[:60]!r}", "a table of name → shape")
    for name, port in value.items():
        if not isinstance(port, list | tuple) or not port or not all(_is_size(size) for size in port):
            raise InputError(f"port {name[:40]!r} has the shape {str(port)[:60]}", "whole numbers from 1 on, N, T and S")
    return {name: tuple(port) for name, port in value.items()}


def _is_size(size: Any) -> bool:
    return size in ("N", "T", "S") if isinstance(size, str) else type(size) is int and 0 < size <= _WIDEST_STATE
