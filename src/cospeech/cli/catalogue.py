"""The tables behind ``cospeech list`` and the documentation, one for each kind, read from the registries."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from importlib import import_module
from inspect import getdoc
from itertools import groupby

from ..errors import CospeechWarning, InputError, nearest

__all__ = ["CATALOGUES", "catalogue", "catalogue_text"]

Row = dict[str, str]


def _first_line(thing: object) -> str:
    return (getdoc(thing) or "").partition("\n")[0].rstrip(".").replace("``", "")


def _list_registry(registry: Mapping[str, str]) -> list[Row]:
    """Rows of a registry of ``module:name``, described by the first line of the docstrings."""
    rows = []
    for name, where in registry.items():
        module, _, attribute = where.partition(":")
        rows.append({"name": name, "what": _first_line(getattr(import_module(module), attribute))})
    return rows


def _models() -> list[Row]:
    from ..models import ENTRIES, MODELS, find_bundle

    more = {True: "; ready to use", False: "; no weights ship: train it first, see docs/training.md"}
    rows = []
    for name in MODELS:
        entry = ENTRIES[name]
        ready = not entry.trains or find_bundle(name) is not None
        needs = ", ".join(["sound", *entry.needs]) if entry.trains else "nothing"
        row = {"name": name, "what": entry.what + more[ready], "paper": entry.paper, "needs": needs}
        rows.append(row | {"ready": "yes" if ready else "no"})
    return rows


def _styles() -> list[Row]:
    """Styles of the rule-based model, then the speakers of the models whose weights ship or come with a plug-in."""
    from ..models import BUNDLE, ENTRIES, SHIPPED, find_bundle
    from ..rules.styles import STYLES
    from ..runtime.bundles.bundle import read_bundle
    from ..runtime.bundles.spec import VOICE

    rows = [{"name": name, "what": style.what, "model": "rules"} for name, style in STYLES.items()]
    weights = {path.stem: path for path in sorted(SHIPPED.glob(f"*{BUNDLE}"))}
    weights |= {name: path for name in ENTRIES if name not in weights and (path := find_bundle(name)) is not None}
    for model, path in weights.items():
        try:
            names = read_bundle(path).fact("styles", list)
        except InputError as error:  # a broken bundle of one plug-in does not hide the others
            warnings.warn(f"the styles of {model!r} cannot be read: {error}", CospeechWarning, stacklevel=2)
            continue
        about = dict.fromkeys(names, "a speaker of its training data") | {VOICE: "the speaker that it estimates from the voice"}
        rows += [{"name": name, "what": about[name], "model": model} for name in names]
    return rows


def _emotions() -> list[Row]:
    from ..audio.emotions import EMOTIONS

    return [{"name": "auto", "what": "follows the arousal of the voice, and an emotion that is surely heard; the default"}] + [
        {"name": name, "what": f"{name}, independent of the speech"} for name in EMOTIONS
    ]


def _formats() -> list[Row]:
    from ..export import FORMATS

    return [
        {
            "name": suffix,
            "what": entry.what,
            "holds": ", ".join(entry.holds),
            "access": "read and write" if entry.readable else "write",
            "opens": entry.opens,
        }
        for suffix, entry in FORMATS.items()
    ]


def _skeletons() -> list[Row]:
    from ..motion.skeletons import SKELETONS

    return [{"name": name, "what": _first_line(import_module(module))} for name, module in SKELETONS.items()]


def _metrics() -> list[Row]:
    from ..metrics import METRICS

    return _list_registry(METRICS)


def _corpora() -> list[Row]:
    from ..corpora import CORPORA

    return [
        {"name": name, "what": entry.what, "access": "read and write" if entry.writable else "read"}
        for name, entry in CORPORA.items()
    ]


def _recipes() -> list[Row]:
    from ..training.recipe import describe_recipe, list_recipes

    return [{"name": name, "what": describe_recipe(name)} for name in list_recipes()]


CATALOGUES: dict[str, Callable[[], list[Row]]] = {
    "models": _models,
    "styles": _styles,
    "emotions": _emotions,
    "formats": _formats,
    "skeletons": _skeletons,
    "metrics": _metrics,
    "corpora": _corpora,
    "recipes": _recipes,
}
"""Kind → function that lists it."""


def catalogue(what: str) -> list[Row]:
    """Everything of a kind: rows with ``name`` and ``what`` (one line of description), in order of importance.

    Raises:
        InputError: there is no such kind.
    """
    if what not in CATALOGUES:
        raise InputError(f"cannot list {what!r}", nearest(what, CATALOGUES))
    return CATALOGUES[what]()


_HOW = {
    "models": "cospeech generate talk.wav --model NAME",
    "styles": "cospeech generate talk.wav --model MODEL --style NAME; mixed: --style NAME:0.7,NAME:0.3",
    "emotions": "cospeech generate talk.wav --emotion NAME",
    "formats": "cospeech generate talk.wav -o talk.SUFFIX; cospeech convert FILE FILE",
    "skeletons": "cospeech generate talk.wav -o talk.bvh --skeleton NAME; cospeech convert FILE FILE.bvh --skeleton NAME",
    "metrics": "cospeech evaluate MODEL --corpus STORE --metrics NAME,NAME; what they mean: docs/metrics.md",
    "corpora": "cospeech prepare NAME FOLDER STORE; synthetic ones: cospeech synthesise FOLDER --layout NAME",
    "recipes": "cospeech train NAME --store STORE; what a recipe is: docs/training.md",
}


def catalogue_text(what: str) -> str:
    """The rows of a kind as text for people: a line each, and how a name is used; styles by model.

    Raises:
        InputError: there is no such kind.
    """
    rows = catalogue(what)
    width = max(len(row["name"]) for row in rows)
    lines: list[str] = []
    for model, group in groupby(rows, lambda row: row.get("model")):
        if model is not None:
            lines += ["", f"--model {model}"] if lines else [f"--model {model}, the default"]
        for text, alike in groupby(group, lambda row: row["what"]):
            row, *others = alike
            if others:  # speakers, of whom no more is known
                lines.append(f"  {', '.join([row['name'], *(other['name'] for other in others)])}: {text}")
                continue
            more = [f"holds {row['holds']}"] if "holds" in row else []
            more += [row["access"]] if "access" in row else []
            lines.append(f"{'  ' if model else ''}{row['name']:<{width}}  {'; '.join([text, *more])}")
    return "\n".join([*lines, "", _HOW[what]])
