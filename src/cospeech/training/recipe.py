"""Recipes: what is trained, on what and how, as a flat TOML file with the sections [model], [needs], [data] and [train].

An unknown key or a value of the wrong kind is an error that says what was meant. Dimensions are never in a recipe: they come
from the store.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import MISSING, asdict, dataclass, field, fields, replace
from itertools import takewhile
from os import PathLike
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from ..errors import InputError, guess, nearest
from ..files import parse_toml, read_regular
from ..limits import RECIPE_BYTES
from .renamed import suggest_key

__all__ = [
    "Data",
    "Optimiser",
    "Recipe",
    "Train",
    "build",
    "change_recipe",
    "check_types",
    "describe_recipe",
    "list_changes",
    "list_recipes",
    "load_recipe",
    "read_recipe",
]

SHIPPED = Path(__file__).with_name("recipes")
"""Where the recipes lie that come with the program: ``NAME.toml``."""

_SENTENCE = re.compile(r"\.\s+(?=\D)")  # the end of a sentence; "et al. 2022" is none
_KINDS = {int: "a whole number", float: "a number", bool: "true or false", str: "text in quotes", NoneType: "nothing"}
FREE = ("data.store", "train.steps", "train.device", "train.threads", "train.save_every", "train.tensorboard")
"""Keys that may change when a run is resumed: they alter how far and where it runs, not what it computes."""

_LARGEST = 2**1000  # ours: larger whole numbers are no floats
T = TypeVar("T")


@dataclass(frozen=True)
class Data:
    """[data]: which store the recipe was written for, and what is taken of it."""

    store: str = ""
    """Folder of the store, where none is named beside the recipe; "": stores/ and the corpus."""
    corpus: str = ""
    """Corpus that the store must hold; "": any."""
    pose: str = ""
    """Pose representation that it must hold; "": any."""
    fps: float = 0.0
    """Frames per second that it must have; 0: any."""
    audio: str | None = None
    """Name of a reduction of the audio columns (audio/features/reduce.py); None: all columns as they are."""
    mirror: bool | None = None
    """true: the store must have mirrored clips; false: they are left out; None: as the store has it."""
    per_clip_normalisation: bool = False
    """Standardise the poses of every recording by its own mean and deviation: how somebody stands and how large they move is
    then not learnt. At run time, a speaker's own or an example's own values set it. Ours."""
    speakers: tuple[str, ...] = ()
    """Names of the speakers that are trained on, in the order in which the model numbers them; none: all of the store.
    Statistics and modes are then theirs alone."""
    words: str | None = None
    """File of fastText vectors (.vec, .bin) of the words, for a model that reads text; None: it learns subwords itself."""
    validation: float = 0.0
    """Share of the training clips held out for validation, for stores without a validation split."""

    def __post_init__(self) -> None:
        if not 0 <= self.validation < 1:
            raise InputError(f"data.validation is {self.validation}", "a share, 0 … 1")


@dataclass(frozen=True)
class Optimiser:
    """How one objective is minimised: Adam, its rate, and the clipping of gradients."""

    lr: float = 1e-3
    """Peak of the learning rate."""
    betas: tuple[float, float] = (0.9, 0.999)
    eps: float = 1e-8
    weight_decay: float = 0.0
    """Adam's: so much of a parameter is added to its gradient (L2)."""
    schedule: str = "constant"
    """One of training/schedule.py: constant, noam, exponential."""
    warmup: int = 3000
    """noam: steps of rising rate."""
    floor: float = 0.0
    """noam, exponential: the rate does not fall below."""
    gamma: float = 1.0
    """exponential: factor …"""
    gamma_every: int = 1
    """… per so many steps."""
    clip_value: float = 0.0
    """Gradients are cut to ± this; 0: they are not."""
    clip_norm: float = 0.0
    """Then scaled down to this norm; 0: they are not."""

    def __post_init__(self) -> None:
        _check(
            self,
            {"lr": 0, "eps": 0, "weight_decay": 0, "floor": 0, "gamma": 0, "clip_value": 0, "clip_norm": 0}
            | {"warmup": 1, "gamma_every": 1},
        )
        if not all(0 <= beta < 1 for beta in self.betas):
            raise InputError(f"train.betas is {[*self.betas]}", "two numbers, 0 … 1")


@dataclass(frozen=True)
class Train(Optimiser):
    """[train]: the loop. It has the keys of `Optimiser`, too; [train.NAME] has those for the objective NAME alone."""

    steps: int = 1000
    batch: int = 64
    """Windows per step, over all processes together."""
    seed: int = 0
    ema: float = 0.0
    """Decay of the running average of the parameters; the average is validated, and kept as best; 0: none."""
    precision: str = "float32"
    """float32, or bfloat16: mixed precision by autocast."""
    device: str = "auto"
    """auto (a GPU where there is one), cpu, cuda, cuda:1, mps …"""
    threads: int = 0
    """Of PyTorch on the CPU; 0: as it likes."""
    balance: bool = False
    """As many windows of each speaker in every batch."""
    log_every: int = 10
    validate_every: int = 500
    """Steps; 0: never, and best is last."""
    validate_batches: int = 8
    save_every: int = 500
    best: str = ""
    """Validation figure whose minimum is best, such as "flow" or "flow.nll"; "": the first."""
    tensorboard: bool = False
    start: str = ""
    """Folder of a run, or bundle of the stylised flow, whose parameters it begins with; "": new ones, by the seed."""
    objectives: Mapping[str, Optimiser] = field(default_factory=dict)
    """Name of an objective → how it is minimised, where that differs."""

    def __post_init__(self) -> None:
        super().__post_init__()
        low = {"steps": 1, "batch": 1, "seed": 0, "ema": 0, "threads": 0, "log_every": 1, "validate_every": 0}
        _check(self, low | {"validate_batches": 1, "save_every": 1})
        if self.ema >= 1:
            raise InputError(f"train.ema is {self.ema}", "below 1, such as 0.999")
        if self.precision not in ("float32", "bfloat16"):
            raise InputError(f"train.precision is {self.precision!r}", nearest(self.precision, ["float32", "bfloat16"]))

    def of(self, objective: str) -> Optimiser:
        """How an objective is minimised."""
        return self.objectives.get(objective, self)


@dataclass(frozen=True)
class Recipe:
    """A recipe as it was read. The keys of its model are checked when the `Config` of the model is built, see `build`."""

    model: str
    config: Mapping[str, Any] = field(default_factory=dict)
    needs: Mapping[str, str] = field(default_factory=dict)
    """Keyword of the model's constructor → folder of the run whose trained model it gets."""
    data: Data = field(default_factory=Data)
    train: Train = field(default_factory=Train)

    def to_dict(self) -> dict[str, Any]:
        """The recipe as in a file: `read_recipe` makes the same recipe of it."""
        train, data = asdict(self.train), {k: v for k, v in asdict(self.data).items() if v is not None}
        train |= train.pop("objectives")
        model = {"name": self.model, **self.config}
        return {"model": model, "needs": dict(self.needs), "data": data, "train": train}


def _check(settings: Any, low: Mapping[str, float]) -> None:
    """Check that numbers are finite and not below their least value."""
    for name, least in low.items():
        value = vars(settings)[name]
        if not least <= value < float("inf"):
            raise InputError(f"train.{name} is {value}", f"at least {least}")


def _kind(hint: Any) -> str:
    """The kind of value that is expected, in words."""
    if get_origin(hint) in (Union, UnionType):
        return " or ".join(_kind(option) for option in get_args(hint) if option is not NoneType)
    if get_origin(hint) is tuple:
        return "a list" if Ellipsis in get_args(hint) else f"a list of {len(get_args(hint))}"
    return _KINDS.get(hint, "something else")


def check_types(kind: type) -> None:
    """Check that a recipe can hold the settings of a network.

    Raises:
        InputError: a field has a type that no recipe holds.
    """
    hints = get_type_hints(kind)
    for name in (each.name for each in fields(kind)):
        if not _is_held(hints[name]):
            text = hints[name].__name__ if isinstance(hints[name], type) and not get_args(hints[name]) else hints[name]
            hint = "int, float, bool, str, tuple[int, ...] and the like, and each of these with | None"
            raise InputError(f"{kind.__qualname__}.{name} is of the type {text}, which no recipe holds", hint)


def _is_held(hint: Any) -> bool:
    if get_origin(hint) in (Union, UnionType):
        return all(map(_is_held, get_args(hint)))
    if get_origin(hint) is tuple:
        return all(inner is Ellipsis or _is_held(inner) for inner in get_args(hint))
    return hint is Any or hint in _KINDS


def _fit(value: Any, hint: Any, where: str) -> Any:
    """A value of TOML in the type of a field: a whole number can be a float, a list is a tuple."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        for option in inner:
            try:
                return _fit(value, option, where)
            except InputError:
                continue
    elif origin is tuple and isinstance(value, list | tuple):
        endless = len(inner) == 2 and inner[1] is Ellipsis
        if endless or len(value) == len(inner):
            return tuple(
                _fit(v, inner[0] if endless else h, where) for v, h in zip(value, inner if not endless else value, strict=True)
            )
    elif hint is float and type(value) in (int, float) and (isinstance(value, float) or abs(value) <= _LARGEST):
        return float(value)
    elif hint is Any or type(value) is hint:
        return value
    raise InputError(f"{where} is {value!r}"[:200], f"it takes {_kind(hint)}")


def build(kind: type[T], values: Mapping[str, Any], section: str) -> T:
    """Build a dataclass from a section of a recipe.

    >>> build(Data, {"corpus": "ted", "fps": 15}, "data").fps
    15.0

    Raises:
        InputError: an unknown key, a missing one, or a value of the wrong kind.
    """
    hints = get_type_hints(kind)
    entries = {f.name: f for f in fields(kind)}  # type: ignore[arg-type]
    for name in values:
        if name not in entries:
            raise InputError(f"no key {section}.{name}", suggest_key(name, entries))
    missing = [n for n, f in entries.items() if n not in values and f.default is MISSING and f.default_factory is MISSING]
    if missing:
        raise InputError(f"the recipe has no {section}.{missing[0]}", f"it takes {_kind(hints[missing[0]])}")
    return kind(**{name: _fit(value, hints[name], f"{section}.{name}") for name, value in values.items()})


def _train(values: Mapping[str, Any]) -> Train:
    """Read [train] and its parts [train.NAME], whose defaults are the values in [train]."""
    own = {name: value for name, value in values.items() if not isinstance(value, Mapping)}
    if "objectives" in own:
        raise InputError("no key train.objectives", "a section [train.NAME] is for one objective")
    whole, defaults = build(Train, own, "train"), {f.name: own[f.name] for f in fields(Optimiser) if f.name in own}
    sections = {name: value for name, value in values.items() if name not in own}
    return replace(whole, objectives={n: build(Optimiser, defaults | dict(v), f"train.{n}") for n, v in sections.items()})


def read_recipe(sections: Mapping[str, Any]) -> Recipe:
    """Read a recipe from the sections of a file.

    Raises:
        InputError: an unknown section or key, a value of the wrong kind, no model.
    """
    for name, value in sections.items():
        if name not in ("model", "needs", "data", "train") or not isinstance(value, Mapping):
            raise InputError(f"no section [{name}] in a recipe", nearest(name, ["model", "needs", "data", "train"]))
    model = dict(sections.get("model", {}))
    name = model.pop("name", None)
    if not isinstance(name, str):
        raise InputError("the recipe names no model", 'it takes a section [model] with name = "…"')
    needs = {key: _fit(value, str, f"needs.{key}") for key, value in sections.get("needs", {}).items()}
    return Recipe(name, model, needs, build(Data, sections.get("data", {}), "data"), _train(sections.get("train", {})))


def _override(sections: dict[str, Any], text: str) -> None:
    """Set ``section.key=value``; the value is TOML, or text without quotes."""
    path, equals, raw = text.partition("=")
    *parents, key = (part.strip() for part in path.split("."))
    if not equals or not parents or not key:
        raise InputError(f"--set {text!r}", "it takes section.key=value, such as train.steps=2000")
    try:
        value = tomllib.loads(f"value = {raw.strip()}")["value"]
    except tomllib.TOMLDecodeError:
        value = raw.strip()
    place = sections
    for parent in parents:
        place = place.setdefault(parent, {})
        if not isinstance(place, dict):
            raise InputError(f"--set {text!r}", f"{parent} is no section")
    place[key] = value


def list_recipes() -> list[str]:
    """Names of the recipes that come with the program."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml"))


def describe_recipe(name: str) -> str:
    """What a recipe that comes with the program trains: the first sentence of the comment at its head."""
    lines = takewhile(lambda line: line.startswith("#"), (SHIPPED / f"{name}.toml").read_text("utf-8").splitlines())
    return _SENTENCE.split(" ".join(line.lstrip("# ") for line in lines), maxsplit=1)[0].rstrip(".")


def _file(path: str) -> Path:
    """The file of a recipe. A bare name, or ``recipes/NAME``, that is no file means the recipe that comes with the program."""
    file = Path(path)
    name = file.name.removesuffix(".toml")
    if file.is_file() or name not in list_recipes() or file.parent not in (Path(), Path("recipes")):
        return file
    return SHIPPED / f"{name}.toml"


def load_recipe(path: str | PathLike[str], overrides: Iterable[str] = ()) -> Recipe:
    """A recipe from a file.

    Args:
        path: of the TOML file; or the name of one that comes with the program (`SHIPPED`).
        overrides: ``"section.key=value"``, put in place of what the file has.

    Raises:
        InputError: no such file, not TOML, or not a recipe; see `read_recipe`.
    """
    file = _file(str(path))
    if not file.exists():
        likely = "" if file.suffix == ".toml" else guess(str(path), list_recipes())
        hint = f"{likely}a TOML file, or one that comes with the program: {', '.join(list_recipes())}"
        raise InputError(f"cannot read {str(path)!r}: No such file or directory", hint)
    sections = parse_toml(read_regular(file, "a recipe", RECIPE_BYTES), repr(str(path)), "see docs/training.md")
    return change_recipe(sections, overrides)


def change_recipe(sections: Mapping[str, Any], overrides: Iterable[str]) -> Recipe:
    """A recipe from the sections of a file, with overrides: ``"section.key=value"``.

    Raises:
        InputError: not an override, or not a recipe; see `read_recipe`.
    """
    edition = deepcopy(dict(sections))
    for text in overrides:
        _override(edition, text)
    return read_recipe(edition)


def _flat(sections: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    entries: dict[str, Any] = {}
    for name, value in sections.items():
        entries |= _flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else {prefix + name: value}
    return entries


def list_changes(
    old: Mapping[str, Any], new: Mapping[str, Any], free: Sequence[str] = FREE, form: str = "{}: {}, now {}"
) -> list[str]:
    """The differences of two recipes, except for keys that may differ: ``["train.lr: 0.001, now 0.002"]``.

    Args:
        old: a recipe, as a dict.
        new: another one.
        free: keys that may differ.
        form: of a difference: key, old value, new value.
    """
    first, second = _flat(old), _flat(new)
    pairs = ((key, first.get(key), second.get(key)) for key in sorted({*first, *second} - {*free}))
    return [form.format(key, _describe(a), _describe(b)) for key, a, b in pairs if _describe(a) != _describe(b)]


def _describe(value: Any) -> str:
    return "nothing" if value is None else repr([*value] if isinstance(value, tuple) else value)
