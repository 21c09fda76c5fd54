"""The systems that turn speech into motion: a registry, and their common interface."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from inspect import signature
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from ..errors import InputError, describe_extra, nearest
from ..files import scratch, workplace
from ..motion.parts import PARTS
from .registry import ENTRIES, MODELS, NETWORKS, ModelEntry

if TYPE_CHECKING:
    from ..audio.speech import Speech
    from ..motion.motion import Motion
    from ..rules.options import GenerationOptions
    from ..rules.plan_edits import Plan

__all__ = [
    "BUNDLE",
    "DEFAULT",
    "ENTRIES",
    "MODELS",
    "NETWORKS",
    "PARTS",
    "SHIPPED",
    "GenerationSession",
    "Model",
    "ModelEntry",
    "PlannedSession",
    "find_bundle",
    "load",
    "plays",
]  # fmt: skip

DEFAULT = "rules"
"""The best model that ships; ``generate`` uses it when no model is named."""

BUNDLE = ".cospeech"
SHIPPED = Path(__file__).parents[1] / "assets" / "bundles"
"""Folder of the weights that come with the package: ``NAME.cospeech``."""


class GenerationSession(Protocol):
    """A session: speech goes in, piece by piece, and the motion of one or several takes comes out."""

    @property
    def emotion(self) -> dict[str, float]:
        """Probability of each emotion, over all speech so far."""
        ...

    @property
    def expression(self) -> dict[str, float]:
        """Weight of each emotion that was played, over all speech so far."""
        ...

    @property
    def arousal(self) -> float | None:
        """Mean arousal of the voice that was played, −1 … 1; None where an emotion is given."""
        ...

    @property
    def speaker(self) -> dict[str, float] | None:
        """Probability of each speaker, over all speech so far, where a system estimates them."""
        ...

    @property
    def style_mixture(self) -> dict[str, float] | None:
        """Speaker → weight, where a mixture of speakers is played."""
        ...

    @property
    def latency(self) -> float:
        """Seconds of sound at 16 kHz after a frame's time that must have been pushed, at most, until the frame is given."""
        ...

    @property
    def look_ahead(self) -> float:
        """Seconds of sound after a frame's time on which the frame depends, at most."""
        ...

    def restyle(self, style: Any) -> None:
        """Change the style while the speech goes on; the new one fades in over half a second."""
        ...

    def set_emotion(self, emotion: Any) -> None:
        """Change the emotion, or set "auto", likewise."""
        ...

    def set_intensity(self, intensity: float) -> None:
        """Change the size of all movement, likewise."""
        ...

    def push(self, chunk: Speech) -> Iterator[Motion]:
        """Take the next piece, at once; yields the motion that is certain now. Motion not taken comes with the next call."""
        ...

    def finish(self) -> Iterator[Motion]:
        """End the speech, at once; yields the rest of the motion."""
        ...

    def push_takes(self, chunk: Speech) -> Iterator[list[Motion]]:
        """As ``push``; yields lists with a piece of every take, all of one length."""
        ...

    def finish_takes(self) -> Iterator[list[Motion]]:
        """As ``finish``, of every take."""
        ...


class PlannedSession(Protocol):
    """A session that was opened with a plan."""

    @property
    def plan(self) -> Plan:
        """The plan as performed so far."""
        ...


class Model(Protocol):
    """The interface of every model; options are the fields of `cospeech.rules.options.GenerationOptions`.

    The same seed gives the same motion, and pieces joined are what ``generate`` gives: ceil(duration × fps) frames.
    """

    @property
    def default_style(self) -> str:
        """Name of the style that is played where none is given."""
        ...

    @property
    def styles(self) -> tuple[str, ...]:
        """Names of the styles that it plays."""
        ...

    @property
    def takes_at_once(self) -> int:
        """How many takes one session plays best; where it is more than 1, ``session`` has the keyword ``takes``."""
        ...

    @property
    def makes(self) -> tuple[str, ...]:
        """The parts of the body, of `PARTS`, that it moves."""
        ...

    @property
    def for_files(self) -> Mapping[str, Any]:
        """Options of a session for a file, whose whole speech is known: a longer look-ahead, for example."""
        ...

    @property
    def latency(self) -> float:
        """Of a session with the usual options; see `GenerationSession`."""
        ...

    @property
    def look_ahead(self) -> float:
        """Of a session with the usual options; see `GenerationSession`."""
        ...

    def generate(self, speech: Speech, **options: Any) -> Motion:
        """Motion for the whole speech."""
        ...

    def stream(self, chunks: Iterable[Speech], **options: Any) -> Iterator[Motion]:
        """Motion in pieces, for speech that comes in pieces."""
        ...

    def session(self, options: GenerationOptions | None = None, /, **keywords: Any) -> GenerationSession:
        """A session to push speech into. Options come as one object, by keywords, or as one object with changes by keywords."""
        ...


def plays(name: str | PathLike[str]) -> bool:
    """Whether `load` accepts a name: a registered model, a bundle by its suffix, or a run folder."""
    try:
        return Path(name).suffix == BUNDLE or str(name) in MODELS or (Path(name) / "config.json").is_file()
    except (OSError, ValueError):  # longer than names can be, say
        return False


def find_bundle(name: str) -> Path | None:
    """The weights that come with a model of `MODELS`; None where there are none."""
    path = Path(ENTRIES[name].weights or SHIPPED / f"{name}{BUNDLE}")
    return path if path.is_file() else None


def load(name: str | PathLike[str] = DEFAULT) -> Model:
    """Load a model.

    >>> type(load("rules")).__name__
    'RuleBasedModel'

    Args:
        name: in `MODELS`; or a bundle, ``mine.cospeech``; or the folder of a run (which needs the extra ``train``).

    Raises:
        InputError: there is no such model (the message names the nearest one), no weights of it ship, or the file is damaged.
    """
    name = str(name)
    if not plays(name):
        raise InputError(f"no model is called {name[:120]!r}", nearest(name, MODELS))
    if Path(name).suffix == BUNDLE or name not in MODELS:
        return _open(Path(name))
    if ENTRIES[name].trains:
        path = find_bundle(name)
        if path is None:
            if weights := ENTRIES[name].weights:
                raise InputError(
                    f"no weights of {name!r} ship: its row names {weights!r}, which is no file", "the path must be whole"
                )
            raise InputError(f"no weights of {name!r} ship", "train it (docs/training.md), and name the run or its bundle")
        return _open(path)
    from ..runtime.mouth import open_default_mouth

    module, _, attribute = MODELS[name].partition(":")
    code = ENTRIES.find_code(name, module, attribute)
    try:
        signature(code).bind(mouth=open_default_mouth)
    except TypeError as error:
        raise InputError(
            f"the model {name!r} cannot be made: {error}", "its class takes mouth= (docs/add_a_model.md)"
        ) from None
    model: Model = code(mouth=open_default_mouth)
    return model


def _open(path: Path) -> Any:
    """A trained system: a bundle, or a run, which becomes one first."""
    from ..runtime.model import TrainedModel

    if path.suffix == BUNDLE:
        return TrainedModel.open(path)
    with workplace(scratch()) as folder:
        try:
            from ..training.export.bundles import bundle_run

            bundle_run(path, folder / f"run{BUNDLE}")
        except ModuleNotFoundError as error:
            if (error.name or "").partition(".")[0] not in ("torch", "onnx"):
                raise
            raise InputError(f"a run needs {error.name} to become a bundle", describe_extra("train")) from None
        return TrainedModel.open(folder / f"run{BUNDLE}")
