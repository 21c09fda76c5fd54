"""Whose style a bundle plays: its speakers by name, examples (a motion of any skeleton and length), and mixtures of both.

What is known of a style is a `StyleEmbedding`. A mixture is a `StyleMixture` of manners, and a source turns it into what a
performance is made of: a style code, a beginning, latents. There are three, all with the same arguments:

`CodeSource`     the style code of the example conditions every frame, latents are random; ours (`FlowConfig.style`).
`SegmentSource`  the latents that would have made the example, under mean speech, drive the synthesis: in order for as long as
                 the example lasts (Ye et al. 2022, section 4.5), then in stretches of a second drawn from it (ours).
`NormalSource`   latents are drawn from mean and covariance of the example's (ours).

The latter two also go without the code (``coded=False``), as the paper does. docs/styles.md has how they compare.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from math import isfinite
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..errors import InputError, nearest
from ..export.registry import FORMATS, reads_body, suffixes
from ..motion.motion import Motion
from ..motion.named_numbers import read_named_numbers
from ..motion.rotations import Array
from .autoregressive_decoder import Source
from .flow_bundle import FlowSystem
from .flow_engine import StudentT
from .manifest import System
from .style_measures import StyleEmbedding, StyleMixture, average_parts, embed_flow_speaker, example, latents_of

__all__ = [
    "CodeSource",
    "NormalSource",
    "SegmentSource",
    "StyleMixture",
    "Styles",
    "Transfer",
    "best_transfer",
    "example_files",
]  # fmt: skip

BLOCK = 1.0  # s; ours: of latents drawn together, about a gesture stroke with its preparation
CHUNK = 64  # frames drawn at once
ALL = 1 - 1e-6  # ours: weights that add up to so much leave nothing to the default style
MOST_WEIGHT = 1e9  # ours: so that shares are numbers


class Transfer(Protocol):
    """What the three sources have in common: how they are made."""

    def __call__(self, system: FlowSystem, blend: StyleMixture, *, seed: int, temperature: float = 1.0) -> Source: ...


class CodeSource:
    """The style by its code; latents as the network was trained to.

    Args:
        system: whose.
        blend: the style.
        seed: of the take.
        temperature: scale of the latents.
    """

    def __init__(self, system: FlowSystem, blend: StyleMixture, *, seed: int, temperature: float = 1.0) -> None:
        rng, sizes = np.random.default_rng([seed, 1]), system.engine.sizes
        begun = [(share, embedding.beginnings[rng.integers(len(embedding.beginnings))]) for share, embedding in blend]
        self.history: Array = average_parts(begun)
        self.style: Array = average_parts([(share, embedding.code) for share, embedding in blend])
        self.speaker_mean: Array = average_parts([(share, embedding.speaker_mean) for share, embedding in blend])
        self.style_gain: Array | None = _size(blend)
        self.model_mean: Array | None = None
        if self.style_gain is not None:  # random latents: what the network makes of them by itself is known
            self.model_mean, self.style_gain = system.statistics.model_mean, self.style_gain / system.statistics.model_std
        self._latents = StudentT(sizes.pose, sizes.nu, seed=seed, temperature=temperature)

    def draw(self, frames: int) -> Array:
        """See `Source`."""
        return self._latents.draw(frames)


class _ExampleSource(CodeSource):
    """What both kinds of latents from examples need.

    Args:
        system, blend, seed, temperature: as of `CodeSource`; the temperature scales how far latents are from their mean.
        coded: whether the example's code, mean pose and deviation are taken too; else those of the default style.
    """

    def __init__(
        self, system: FlowSystem, blend: StyleMixture, *, seed: int, temperature: float = 1.0, coded: bool = True
    ) -> None:
        super().__init__(system, blend, seed=seed, temperature=temperature)
        sized = blend
        if not coded:
            plain = embed_flow_speaker(system, system.style)
            self.style, self.speaker_mean, sized = plain.code, plain.speaker_mean, ((1.0, plain),)
        self.style_gain = _size(sized)  # an example's latents make its own poses
        self.model_mean = None if self.style_gain is None else np.zeros(system.engine.sizes.pose, np.float32)
        self._system, self._temperature = system, np.float32(temperature)
        self._kept = np.zeros((0, system.engine.sizes.pose), np.float32)
        self._rng = np.random.default_rng([seed, 2])
        self._pieces = [
            (share, latents_of(system, embedding, embedding.code if coded else self.style)) for share, embedding in blend
        ]
        self._blocks = self._generate_blocks()

    def _generate_blocks(self) -> Iterator[Array]:
        raise NotImplementedError

    def draw(self, frames: int) -> Array:
        """See `Source`; blocks are drawn whole, so that they do not depend on who asks for how much."""
        while len(self._kept) < frames:
            self._kept = np.concatenate([self._kept, next(self._blocks)])
        out, self._kept = self._kept[:frames], self._kept[frames:]
        return out


class SegmentSource(_ExampleSource):
    """The example's own latents: in order while they last, then blocks of a second, each from anywhere in it.

    Of a mixture every block comes from one of the manners, by their shares; speakers by name give random latents.
    """

    def _generate_blocks(self) -> Iterator[Array]:
        means = [np.mean(np.concatenate(found), 0) if found else None for _, found in self._pieces]
        if len(self._pieces) == 1 and means[0] is not None:
            for piece in self._pieces[0][1]:
                yield self._scale(piece, means[0])
        length = max(1, round(BLOCK * self._system.fps))
        shares = np.array([share for share, _ in self._pieces])
        while True:
            chosen = int(self._rng.choice(len(shares), p=shares / shares.sum()))
            found, mean = self._pieces[chosen][1], means[chosen]
            if mean is None:
                yield self._latents.draw(length)
                continue
            sizes = np.array([max(1, len(piece) - length + 1) for piece in found])
            place = int(self._rng.integers(sizes.sum()))
            which = int(np.searchsorted(np.cumsum(sizes), place, "right"))
            start = place - int(sizes[:which].sum())
            yield self._scale(found[which][start : start + length], mean)

    def _scale(self, latents: Array, mean: Array) -> Array:
        return (mean + self._temperature * (latents - mean)).astype(np.float32)


class NormalSource(_ExampleSource):
    """Latents with mean and covariance of the example's, frame by frame; of a mixture, both are mixed.

    The covariance is drawn towards that of random latents, the more so the shorter the example is.
    """

    def _generate_blocks(self) -> Iterator[Array]:
        sizes = self._system.engine.sizes
        spread = sizes.nu / (sizes.nu - 2) if sizes.nu > 2 else 1.0
        mean, covariance = np.zeros(sizes.pose), np.zeros((sizes.pose, sizes.pose))
        for share, found in self._pieces:
            own = spread * np.eye(sizes.pose)
            if found:
                z = np.concatenate(found).astype(np.float64)
                trust = len(z) / (len(z) + sizes.pose)
                own = trust * np.cov(z.T, bias=True) + (1 - trust) * own
                mean += share * z.mean(0)
            covariance += share * own
        mix = np.linalg.cholesky(covariance / spread).T
        while True:
            yield (mean + self._latents.draw(CHUNK) @ mix).astype(np.float32)


def best_transfer(system: FlowSystem) -> Transfer:
    """The way that measured best (docs/styles.md): by the code, for a system that has codes; else by latents."""
    return CodeSource if system.engine.sizes.style else SegmentSource


def _size(blend: StyleMixture) -> Array | None:
    """(D,) deviation of the poses, for systems that know them by their recording's own."""
    spreads = [(share, embedding.style_gain) for share, embedding in blend if embedding.style_gain is not None]
    return average_parts(spreads) if spreads else None


# styles by what users say ---------------------------------------------------------------------------------------------


class Styles:
    """The styles of a system: its speakers, and any example.

    Args:
        system: whose.
        embed_flow_speaker: what it knows of a speaker.
        example: what a motion shows it, which has a name for messages.
    """

    def __init__(
        self,
        system: System,
        embed_flow_speaker: Callable[[Any, str], StyleEmbedding] = embed_flow_speaker,
        example: Callable[[Any, Motion, str], StyleEmbedding] = example,
    ) -> None:
        self._system, self._named, self._example = system, embed_flow_speaker, example
        self._seen: OrderedDict[tuple[str, int, int], StyleEmbedding] = OrderedDict()

    def blend(self, style: object) -> StyleMixture:
        """What to play.

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
            raise InputError(f"style weights {_describe(style)}", "positive numbers, as in ada:0.7,clip.bvh:0.3")
        scale = max(total, 1.0) if total < ALL else total
        parts = [(weight / scale, self._find_embedding(who)) for who, weight in weights.items() if weight > 0]
        if total < ALL:
            parts.append((1.0 - total, self._named(self._system, self._system.style)))
        return tuple(parts)

    def _find_embedding(self, who: object) -> StyleEmbedding:
        """One part of a mixture; files that were read lately are not read again."""
        if isinstance(who, str) and who in self._system.styles:
            return self._named(self._system, who)
        if isinstance(who, Motion):
            return self._example(self._system, who, "the example")
        path = Path(fspath(who))  # type: ignore[call-overload]
        try:
            status = path.stat()
        except (OSError, ValueError):
            status = None  # what is wrong, the reader says better
        key = (str(path), status.st_mtime_ns, status.st_size) if status else ("", 0, 0)
        if status is None or key not in self._seen:
            embedding = self._example(self._system, Motion.load(path), repr(path.name))
            if status is None:
                return embedding
            self._seen[key] = embedding
            while len(self._seen) > _KEPT:
                self._seen.popitem(last=False)
        return self._seen[key]


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


_KEPT = 8  # ours: examples remembered


def _weights(style: object, names: tuple[str, ...]) -> dict[Any, float]:
    """Name, path or motion → its weight, as the user said it."""
    if style is None:
        return {}
    if isinstance(style, Motion):
        return {style: 1.0}
    if isinstance(style, PathLike):
        return {Path(_check_example(fspath(style), names)): 1.0}
    if isinstance(style, Mapping) and style:
        found: dict[Any, float] = {}
        for who, weight in style.items():
            if not isinstance(weight, int | float | np.number) or isinstance(weight, bool):
                raise InputError(f"weight {weight!r} of style {_describe(who)}", "a number")
            key = who if isinstance(who, Motion) else _key(str(who) if isinstance(who, str | PathLike) else who, names)
            found[key] = found.get(key, 0.0) + float(weight)
        return found
    if not isinstance(style, str) or not style.strip():
        raise InputError(
            f"style {_describe(style)}", "a name, a motion file, a Motion, or a mixture such as ada:0.7,clip.bvh:0.3"
        )
    text = style.strip()
    if _is_file(text):
        return {Path(text): 1.0}
    found = {}
    for who, weight, _ in read_named_numbers(
        text, number="weight", of="style", hint="a number, as in ada:0.7,clip.bvh:0.3",
        is_name=lambda who: who in names or _has_body(who),
    ):  # fmt: skip
        key = _key(who, names)
        found[key] = found.get(key, 0.0) + (1.0 if weight is None else weight)
    return found


def _key(who: object, names: tuple[str, ...]) -> object:
    return who if who in names else Path(_check_example(who, names))


def _check_example(who: object, names: tuple[str, ...]) -> str:
    """The name of a file that may be an example.

    Raises:
        InputError: it is none, and nobody's name either.
    """
    if not isinstance(who, str):
        raise InputError(f"style {_describe(who)}", "a name, a motion file or a Motion")
    if _has_body(who):
        return who
    known = " ".join(suffixes(reads_body))
    if Path(who).suffix and not who.endswith(".") and (_is_file(who) or "/" in who):
        raise InputError(f"no example of style can be read from {who[:120]!r}", f"motion files: {known}")
    raise InputError(f"no style is called {who[:60]!r}", f"{nearest(who, names)}; or an example: {known}")


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
