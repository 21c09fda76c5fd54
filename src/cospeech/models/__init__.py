"""The systems that turn speech into motion: a registry, and what all of them can do."""

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
"""The best that ships: what ``generate`` uses when no model is named."""

BUNDLE = ".cospeech"
SHIPPED = Path(__file__).parents[1] / "assets" / "bundles"
"""Where the weights lie that come with the package: ``NAME.cospeech``."""


class GenerationSession(Protocol):
    """A session: speech goes in, piece by piece, and the motion of one or several takes comes out."""

    @property
    def emotion(self) -> dict[str, float]:
        """Probability of each emotion, over all that was heard."""
        ...

    @property
    def expression(self) -> dict[str, float]:
        """Weight of each emotion that was played, over the speech."""
        ...

    @property
    def arousal(self) -> float | None:
        """Mean arousal of the voice that was played, −1 … 1; None where an emotion is given."""
        ...

    @property
    def speaker(self) -> dict[str, float] | None:
        """Probability of each speaker, over all that was heard, where a system tells them apart."""
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
        """Another style while the speech goes on, faded in over half a second."""
        ...

    def set_emotion(self, emotion: Any) -> None:
        """Another emotion, or "auto", likewise."""
        ...

    def set_intensity(self, intensity: float) -> None:
        """Another size of all movement, likewise."""
        ...

    def push(self, chunk: Speech) -> Iterator[Motion]:
        """Hear the next piece, at once; gives the motion that is certain now. What is not taken comes with the next call."""
        ...

    def finish(self) -> Iterator[Motion]:
        """The speech is over, from now on; gives the rest of the motion."""
        ...

    def push_takes(self, chunk: Speech) -> Iterator[list[Motion]]:
        """As ``push``; gives lists with a piece of every take, all of one length."""
        ...

    def finish_takes(self) -> Iterator[list[Motion]]:
        """As ``finish``, of every take."""
        ...


class PlannedSession(Protocol):
    """A session that was opened with a plan."""

    @property
    def plan(self) -> Plan:
        """What was performed so far."""
        ...


class Model(Protocol):
    """What every model offers; options are the fields of `cospeech.rules.options.GenerationOptions`.

    The same seed gives the same motion, and pieces joined are what ``generate`` gives: ceil(duration × fps) frames.
    """

    @property
    def default_style(self) -> str:
        """Name of the style that is played where none is asked for."""
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
        """The parts of `PARTS` that it moves."""
        ...

    @property
    def for_files(self) -> Mapping[str, Any]:
        """Options of a session for a file, whose speech is known as a whole: a longer look-ahead, for example."""
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
        """A session to push speech into; options come whole, by keywords, or whole with some changed."""
        ...


def plays(name: str | PathLike[str]) -> bool:
    """Whether `load` takes it: a registered name, a bundle by its suffix, or a run folder."""
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
            if named := ENTRIES[name].weights:
                raise InputError(
                    f"no weights of {name!r} ship: its row names {named!r}, which is no file", "the path must be whole"
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
