"""The training set of a run: a recipe and a store are checked against each other, and give facts, statistics and batches."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from .. import __version__
from ..audio.features.reduce import REDUCTIONS, audio_columns, has_like_columns, louder, preparation_option, reduce_audio
from ..corpora.store import Store
from ..errors import InputError, nearest
from ..models.nn.trainable import Trainable
from ..motion.poses.joints import hand_columns, part_columns
from ..motion.rotations import Array
from .audio_source import with_audio
from .batch_loader import (
    BatchLoader,
    ClipNormaliser,
    Normaliser,
    Reduce,
    check_mirror,
    clip_moments,
    pool_columns,
    standard_audio,
    standard_pose,
)
from .calibration_clips import examples_of
from .checkpoint import build_config, load_run, network, read_tensors
from .movement_modes import with_modes
from .recipe import Data, Recipe, list_changes, read_recipe
from .speaker_subset import of_speakers
from .style_controls import control_quantiles, with_controls
from .texts import with_text
from .windows import Windows

__all__ = ["ARRAY_SOURCES", "DIMENSIONS", "ArraySource", "TrainingSet", "check_same", "open_set"]


QUANTILES = 1001
"""[ours] Number of quantiles of a speaker's poses: a lip that moves in 1 of 100 frames has ten of them."""


@dataclass(frozen=True)
class TrainingSet:
    """Facts of a run, its statistics, the trained models that it needs, and its batches."""

    facts: dict[str, Any]
    statistics: dict[str, Tensor]
    needs: dict[str, nn.Module]
    store: Store
    data: Data
    standards: dict[str, Normaliser]
    reduce: Reduce | None
    moments: ClipNormaliser | None

    def examples(self) -> dict[str, Tensor]:
        """The data that a bundle needs; nothing without audio."""
        if "audio" not in self.standards:
            return {}
        arrays = examples_of(self.store, self.standards["pose"], self.standards["audio"], self.reduce, self.moments)
        return {name: torch.from_numpy(array) for name, array in arrays.items()}

    def feed(self, model: Trainable, split: str, balanced: bool) -> BatchLoader:
        """Batches of a split, with the arrays and windows that a model needs."""
        windows = Windows(
            self.store, model.window, model.arrays, split=split, balanced=balanced, mirror=self.data.mirror is not False,
            held_out=self.data.validation, spare=model.optional_arrays,
        )  # fmt: skip
        return BatchLoader(windows, self.standards, self.reduce, self.moments)


class ArraySource(NamedTuple):
    """How an array is computed from the arrays of a store."""

    store: Store
    """The same store, with the array."""
    normaliser: Normaliser | None = None
    """How the array is standardised; None: it is fed as it is."""
    statistics: Mapping[str, Array] = {}
    """Further statistics that a run keeps."""


def _control(store: Store, data: Data, config: Any) -> ArraySource:
    store = with_controls(store)
    return ArraySource(store, Normaliser(*store.statistics("control")), {"control_quantiles": control_quantiles(store)})


def _text(store: Store, data: Data, config: Any) -> ArraySource:
    return ArraySource(with_text(store, data.words))


def _cluster(store: Store, data: Data, config: Any) -> ArraySource:
    store, centres = with_modes(store, config.modes)
    return ArraySource(store, statistics={"cluster_centres": centres})


ARRAY_SOURCES: dict[str, Callable[[Store, Data, Any], ArraySource]] = {"control": _control, "text": _text, "cluster": _cluster}
"""Array that networks use and no store has → (store, [data] of the recipe, settings of the network) → its source."""


def open_set(recipe: Recipe, store: Store, device: torch.device) -> TrainingSet:
    """Make the training set of a recipe and a store.

    Raises:
        InputError: they do not fit, or the model has no such settings.
    """
    data, kind = recipe.data, network(recipe.model)
    config = build_config(recipe.model, recipe.config)
    _check_store(data, store)
    if data.speakers:
        store = of_speakers(store, data.speakers)
    check_mirror(store, data.mirror)
    _check_encoder(kind.encoder_for(config), store)
    store = with_audio(store, data.audio)
    reduce = _reduction(data.audio, store)
    standards = {"pose": standard_pose(store)}
    if "audio" in store.arrays:
        standards["audio"] = standard_audio(store, reduce)
        if data.audio is not None and has_like_columns(data.audio):
            standards["audio"] = pool_columns(standards["audio"])
    own: dict[str, Array] = {}
    arrays = kind.arrays_for(config)
    for name in (name for name in ARRAY_SOURCES if name in arrays):
        store, normaliser, extras = ARRAY_SOURCES[name](store, data, config)
        own |= extras
        if normaliser is not None:
            standards[name] = normaliser
    if kind.wants_quantiles:
        own["pose_quantiles"] = pose_quantiles(store)
    statistics = {f"{n}_{w}": torch.from_numpy(v) for n, s in standards.items() for w, v in s._asdict().items()}
    statistics |= {name: torch.from_numpy(array) for name, array in own.items()}
    needs, need_facts = _needs(recipe, store, statistics)
    facts = {
        "cospeech": __version__, "torch": torch.__version__, "model": recipe.model, "config": asdict(config),
        "sizes": _dimensions(kind.dimensions_for(config), store, data, standards), "needs": need_facts,
        "recipe": recipe.to_dict(), "store": _facts_of(store),
    }  # fmt: skip
    moments = clip_moments(store, standards["pose"]) if data.per_clip_normalisation else None
    return TrainingSet(facts, statistics, {n: m.to(device) for n, m in needs.items()}, store, data, standards, reduce, moments)


def pose_quantiles(store: Store) -> Array:
    """(S, 1001, D) quantiles 0, 0.001 … 1 of each speaker's poses in the training split; without any there, of all clips."""
    quantiles = []
    for speaker in store.speakers:
        own = [clip for clip in store.clips if clip.split == "train" and clip.speaker == speaker] or store.clips
        poses = np.concatenate([store.clip(clip)["pose"] for clip in own])
        quantiles.append(np.quantile(poses, np.linspace(0, 1, QUANTILES), axis=0))
    return np.stack(quantiles).astype(np.float32)


def _check_store(data: Data, store: Store) -> None:
    """Check that a store is one that a recipe was written for.

    Raises:
        InputError: it is of another corpus, pose representation or rate.
    """
    pairs = {"corpus": (data.corpus, store.corpus), "pose": (data.pose, store.pose), "fps": (data.fps, store.fps)}
    for what, (value, has) in pairs.items():
        if value and value != has:
            problem = f"the recipe is for {what} {value!r}, the store {str(store.folder)!r} has {has!r}"
            fits = f"`{_command_for(data, store)}` makes one that fits"
            own = f"--set data.corpus={has} trains on this one" if what == "corpus" else ""
            raise InputError(problem, f"{own}; {fits}" if own else f"{fits}; or set data.{what}")


def _command_for(data: Data, store: Store) -> str:
    """The command that makes a store for a recipe."""
    options = [f"--pose {data.pose}"] if data.pose else []
    options += [f"--fps {data.fps:g}"] if data.fps else []
    options += ["--mirror"] if data.mirror else []
    options += [preparation_option(data.audio)] if data.audio in REDUCTIONS else []
    return " ".join(["cospeech prepare", data.corpus or store.corpus, "RAW STORE", *filter(None, options)])


def _louder(store: Store, data: Data, standards: Mapping[str, Normaliser]) -> list[float]:
    """By how much each standardised number of speech grows with 10 dB; empty where the audio has no reduction."""
    gains: list[float] = [] if data.audio is None else (np.array(louder(data.audio)) / standards["audio"].std).tolist()
    return gains


DIMENSIONS: dict[str, Callable[[Store, Data, Mapping[str, Normaliser]], Any]] = {
    "pose": lambda store, data, standards: int(store.arrays["pose"].shape[1]),
    "audio": lambda store, data, standards: len(standards["audio"].mean) if "audio" in standards else 0,
    "speakers": lambda store, data, standards: len(store.speakers),
    "words": lambda store, data, standards: len(store.words),
    "hands": lambda store, data, standards: hand_columns(store.names["pose"]),
    "parts": lambda store, data, standards: part_columns(store.names["pose"]),
    "text": lambda store, data, standards: 0 if data.words is None else int(store.arrays["text"].shape[1]),
    "louder": _louder,
    "representation": lambda store, data, standards: store.pose,
}
"""Keyword of a network's constructor → its value for a store: D, A, S, number of different words, the pose columns of the hands
and those of each part of the body, the width of a word vector (0: ids of subwords), how the speech grows with its level, and
the name of the pose representation."""
_ALWAYS = ("pose", "audio", "speakers", "words")  # every run keeps these, also where its network does not take them


def _dimensions(names: Sequence[str], store: Store, data: Data, standards: Mapping[str, Normaliser]) -> dict[str, Any]:
    """Name → value of the dimensions that a run keeps.

    Raises:
        InputError: a network takes another dimension.
    """
    if unknown := [name for name in names if name not in DIMENSIONS]:
        raise InputError(f"no dimension is called {unknown[0]!r}", nearest(unknown[0], DIMENSIONS))
    return {name: DIMENSIONS[name](store, data, standards) for name in dict.fromkeys((*_ALWAYS, *names))}


def _check_encoder(encoder: str | None, store: Store) -> None:
    """Check that the speech of a store went through the CNN of the wav2vec 2.0 model whose transformer is trained.

    Raises:
        InputError: it went through that of another model.
    """
    encoders = {name.rpartition(" ")[0] for name in store.names.get("wav2vec", ())}
    if encoder is not None and encoders and encoders != {own := Path(encoder).name}:
        hint = f"prepare it with --wav2vec {encoder}, or set model.encoder"
        raise InputError(f"the store {str(store.folder)!r} was heard by {encoders.pop()!r}, the recipe has {own!r}", hint)


def _reduction(name: str | None, store: Store) -> Reduce | None:
    """A reduction of the audio columns by its name.

    Raises:
        InputError: the store has other columns than the reduction takes.
    """
    if name is None:
        return None
    if "audio" in store.arrays and (has := store.names["audio"]) != (columns := audio_columns(name)):
        fits = ", ".join(other for other in REDUCTIONS if audio_columns(other) == has)
        if preparation_option(name):
            raise InputError(f"the store has no {name!r}", f"prepare it again with {preparation_option(name)}")
        problem = f"audio {name!r} is made of {len(columns)} columns {columns[0]!r} …, the store has {len(has)}, {has[0]!r} …"
        raise InputError(problem, f"set data.audio to {fits}" if fits else "leave data.audio out")
    return partial(reduce_audio, name=name)


def _facts_of(store: Store) -> dict[str, Any]:
    """The facts of a store that a run keeps; its path is not among them."""
    names = {name: list(columns) for name, columns in store.names.items()}
    seconds = sum(clip.frames for clip in store.clips if clip.split == "train") / store.fps
    return {
        "corpus": store.corpus, "pose": store.pose, "fps": store.fps, "clips": len(store.clips), "frames": len(store),
        "train_seconds": seconds, "speakers": list(store.speakers), "columns": names,
    }  # fmt: skip


def _needs(recipe: Recipe, store: Store, own: Mapping[str, Tensor]) -> tuple[dict[str, nn.Module], dict[str, Any]]:
    """The trained models of [needs], frozen, and the facts from which they can be built again."""
    models, need_facts = dict[str, nn.Module](), {}
    for name, folder in recipe.needs.items():
        if not (Path(folder) / "config.json").is_file():
            first = f"`cospeech train {Path(folder).name}` makes it; --set needs.{name}=RUN names another"
            raise InputError(f"the recipe needs the run {folder!r}, which is not there", first)
        model, facts = load_run(folder)
        theirs, _ = read_tensors(Path(folder) / "statistics.safetensors")
        alike = (
            facts["store"]["pose"] == store.pose
            and facts["recipe"]["data"].get("per_clip_normalisation", False) == recipe.data.per_clip_normalisation
        )
        if not alike or not _alike(theirs, own, "pose"):
            raise InputError(
                f"the run {folder!r} was trained on other poses than those of {str(store.folder)!r}", "train it anew"
            )
        models[name] = model.requires_grad_(False)
        need_facts[name] = {key: facts[key] for key in ("model", "config", "sizes", "needs")}
    return models, need_facts


def _alike(a: Mapping[str, Tensor], b: Mapping[str, Tensor], array: str) -> bool:
    """Whether two statistics of an array are equal up to rounding."""
    names = [f"{array}_{what}" for what in ("mean", "std")]
    return all(n in a and n in b and a[n].shape == b[n].shape and torch.allclose(a[n], b[n], 1e-4, 1e-5) for n in names)


def check_same(old: Mapping[str, Any], new: Mapping[str, Any], was: Mapping[str, Tensor], now: Mapping[str, Tensor]) -> None:
    """Check that a run may continue: recipe, model and data are the same, except for what may change.

    Raises:
        InputError: it names what differs.
    """
    new = json.loads(json.dumps(new))
    changes = list_changes(
        read_recipe(old["recipe"]).to_dict(), new["recipe"]
    )  # keys that are newer than the run have their defaults
    changes = [text for text in changes if not text.startswith("needs.")]  # paths: what is there is compared
    for part in ("config", "sizes", "store", "needs"):
        changes += list_changes({part: old[part]}, {part: new[part]})
    if changes:
        more = f", and {len(changes) - 1} more" if len(changes) > 1 else ""
        raise InputError(f"the run began with {changes[0]}{more}", "a run keeps its recipe and store; --out begins another")
    for name, value in now.items():
        array = name.rpartition("_")[0]
        if name not in was or was[name].shape != value.shape or not torch.allclose(was[name], value, 1e-4, 1e-5):
            raise InputError(f"the {array} statistics of the store are not those that the run began with", "has it changed?")
