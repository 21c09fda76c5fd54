"""Reads what a user names as style: a speaker, an example, or a mixture of them."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from math import isfinite
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, nearest
from ...export import read
from ...export.registry import FORMATS, reads_body, suffixes
from ...motion.bone_map_checks import names_joints
from ...motion.motion import Motion
from ...motion.named_numbers import read_named_numbers
from ..system import System
from .embedding import StyleEmbedding, StyleMixture
from .space import StyleSpace

__all__ = ["StyleMixture", "Styles", "example_files", "read_clip_by_map"]

ALL = 1 - 1e-6  # ours: weights that add up to so much leave nothing to the default style
MOST_WEIGHT = 1e9  # ours: so that shares are numbers


class Styles:
    """The styles of a system: its speakers, and any example.

    Args:
        system: the bundle, opened.
        space: what its styles are.
    """

    def __init__(self, system: System, space: StyleSpace) -> None:
        self._system, self._space = system, space
        self._cache: OrderedDict[tuple[str, int, int], StyleEmbedding] = OrderedDict()

    def blend(self, style: object) -> StyleMixture:
        """The mixture of styles to play.

        Args:
            style: None (the default style); a speaker's name; a motion file; a mixture of them with weights
                (``"ada:0.7,clip.bvh:0.3"``); a `Motion`; or a dict from any of these to weights. Weights that add up to less
                than 1 leave the rest to the default style, so that ``"clip.bvh:0.5"`` is half way to the example; larger sums
                are brought to 1.

        Raises:
            InputError: a name, file or weight that cannot be used.
        """
        weights = _weights(style, self._system.styles)
        total = sum(weights.values())
        if not all(isfinite(w) and w >= 0 for w in weights.values()) or total >= MOST_WEIGHT:
            raise InputError(
                f"the weights of style {_describe(style)} are not usable", "positive numbers, as in ada:0.7,clip.bvh:0.3"
            )
        scale = max(total, 1.0) if total < ALL else total
        parts = [(weight / scale, self._find_embedding(who)) for who, weight in weights.items() if weight > 0]
        if total < ALL:
            parts.append((1.0 - total, self._space.by_name(self._system.style)))
        return tuple(parts)

    def _find_embedding(self, who: object) -> StyleEmbedding:
        """One part of a mixture; files that were read lately are not read again."""
        if isinstance(who, str) and who in self._system.styles:
            return self._space.by_name(who)
        if isinstance(who, Motion):
            return self._space.by_example(who)
        path = Path(fspath(who))  # type: ignore[call-overload]
        try:
            status = path.stat()
        except (OSError, ValueError):
            status = None  # the reader has the better error
        key = (str(path), status.st_mtime_ns, status.st_size) if status else ("", 0, 0)
        if status is None or key not in self._cache:
            embedding = self._space.by_example(Motion.load(path), repr(path.name))
            if status is None:
                return embedding
            self._cache[key] = embedding
            while len(self._cache) > _MOST_EXAMPLES:
                self._cache.popitem(last=False)
        return self._cache[key]


def example_files(style: object) -> list[Path]:
    """The motion files that a style names, whether they exist or not; nothing is checked."""
    if isinstance(style, Mapping):
        return [path for who in style for path in example_files(who)]
    if not isinstance(style, str | PathLike):
        return []
    text = fspath(style)
    if not isinstance(text, str) or _is_file(text):
        return [Path(text)] if isinstance(text, str) else []
    parts = read_named_numbers(text, number="", of="", hint="", is_name=lambda who: False)
    return [Path(part.name) for part in parts if _has_body(part.name)]


def read_clip_by_map(style: object, bone_map: Mapping[str, str]) -> Motion | None:
    """The clip that is the style, where a map names its joints; None where it is no file, or one with other joints.

    Args:
        style: as of `Styles.blend`; of a mixture no clip is mapped.
        bone_map: our name → name of a joint.
    """
    files = example_files(style)
    if not isinstance(style, str | PathLike) or files != [Path(fspath(style))] or not files[0].is_file():
        return None
    clip = read(files[0], bone_map=bone_map)
    return clip if names_joints(bone_map, clip.skeleton) else None


_MOST_EXAMPLES = 8  # ours: examples remembered


def _weights(style: object, names: tuple[str, ...]) -> dict[Any, float]:
    """Name, path or motion → its weight, as the user gave it."""
    if style is None:
        return {}
    if isinstance(style, Motion):
        return {style: 1.0}
    if isinstance(style, PathLike):
        return {Path(_check_example(fspath(style), names)): 1.0}
    if isinstance(style, Mapping) and style:
        weights: dict[Any, float] = {}
        for who, weight in style.items():
            if not isinstance(weight, int | float | np.number) or isinstance(weight, bool):
                raise InputError(f"the weight of style {_describe(who)} is {weight!r}", "a number")
            key = who if isinstance(who, Motion) else _key(str(who) if isinstance(who, str | PathLike) else who, names)
            weights[key] = weights.get(key, 0.0) + float(weight)
        return weights
    if not isinstance(style, str) or not style.strip():
        hint = "a name, a motion file, a Motion, or a mixture such as ada:0.7,clip.bvh:0.3"
        raise InputError(f"style {_describe(style)} cannot be used", hint)
    text = style.strip()
    if _is_file(text):
        return {Path(text): 1.0}
    weights = {}
    for who, weight, _ in read_named_numbers(
        text, number="weight", of="style", hint="a number, as in ada:0.7,clip.bvh:0.3",
        is_name=lambda who: who in names or _has_body(who),
    ):  # fmt: skip
        key = _key(who, names)
        weights[key] = weights.get(key, 0.0) + (1.0 if weight is None else weight)
    return weights


def _key(who: object, names: tuple[str, ...]) -> object:
    return who if who in names else Path(_check_example(who, names))


def _check_example(who: object, names: tuple[str, ...]) -> str:
    """The name of a file that may be an example.

    Raises:
        InputError: it is no such file, and no name of a style.
    """
    if not isinstance(who, str):
        raise InputError(f"style {_describe(who)} cannot be used", "a name, a motion file or a Motion")
    if _has_body(who):
        return who
    formats = " ".join(suffixes(reads_body))
    if Path(who).suffix and not who.endswith(".") and (_is_file(who) or "/" in who):
        raise InputError(f"no example of style can be read from {who[:120]!r}", f"motion files: {formats}")
    raise InputError(f"no style is called {who[:60]!r}", f"{nearest(who, names)}; or an example: {formats}")


def _has_body(text: str) -> bool:
    _, dot, end = text.rpartition(".")
    entry = FORMATS.get(f".{end.lower()}") if dot else None
    return entry is not None and reads_body(entry)


def _is_file(text: str) -> bool:
    try:
        return _has_body(text) and Path(text).is_file()
    except (OSError, ValueError):
        return False


def _describe(style: object) -> str:
    return "a motion" if isinstance(style, Motion) else repr(str(style)[:60])
