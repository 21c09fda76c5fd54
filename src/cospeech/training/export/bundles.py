"""``cospeech bundle``: turns a training run into one file that plays without PyTorch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ...audio.emotions import EMOTIONS
from ...errors import InputError, nearest
from ...motion.rotations import Array
from ...runtime.bundles.spec import VOICE, half, unpack_half
from ...runtime.bundles.statistics import Statistics
from ...runtime.network import Network
from ...runtime.samplers import open_sampler
from ...runtime.system import write_networks
from ..checkpoint import load_run, read_facts, read_tensors, stands_for
from ..processes import surroundings
from ..train import Tell
from .calibration import calibrate, difference, relative_error, stretch_rows
from .exported_model import ExportedModel, export_model
from .flow import bundle_flow, control_quantiles

__all__ = ["EXAMPLES", "bundle_run"]

EXAMPLES = "examples.safetensors"
"""Of a run folder: what `cospeech.training.calibration_clips.examples_of` took from the store."""


@surroundings(1, torch.device("cpu"))  # steps this small take longer on several threads, which wait for each other
def bundle_run(
    run: str | PathLike[str],
    path: str | PathLike[str],
    *,
    which: str = "best",
    small: bool = True,
    smooth: int | None = None,
    card: str = "",
    style: str | None = None,
    rests: bool = False,
    emotion_strength: Mapping[str, float] | None = None,
    progress: Tell | None = None,
) -> None:
    """Make a bundle of a run.

    Args:
        run: folder made by `cospeech.training.train.train`.
        path: file to write, ``NAME.cospeech``.
        which: "best" or "last" parameters; see `cospeech.training.checkpoint.load_run` for a run that has no best.
        small: keep weights in fewer bits: the large products of flows in 8, all weights of other networks in 16; manifest and
            card then say by how much that moves poses (``rounding``).
        smooth: frames to either side over which poses are averaged (binomial weights); default: that of the network.
        card: Markdown text; default: the facts of the run.
        style: name of the speaker whose style is played where no style is named; default: the style that the network estimates
            from the voice, or, where it estimates none, that of the first speaker.
        rests: whether hands come to rest in silence (`cospeech.runtime.rest_in_silence`).
        emotion_strength: emotion → how much of it the network is given where it is played, 0 … 1; the rest is neutral.
        progress: is told how much is done, of how much, and what is being done.

    Raises:
        InputError: not a run, or of a system that has no bundles.
    """
    target = Path(path)
    if target.suffix != ".cospeech":
        raise InputError(f"a bundle cannot be called {str(target)!r}", "its name ends in .cospeech")
    folder = Path(run)
    facts = read_facts(folder)
    model: Any = load_run(folder, which)[0]
    smooth = model.smooth if smooth is None else smooth
    if progress is not None:
        progress(0, None, "exporting the networks")
    export = export_model(model, facts["model"])
    arrays = {
        name: tensor.numpy()
        for file in ("statistics.safetensors", EXAMPLES)
        for name, tensor in read_tensors(folder / file)[0].items()
    }
    audio = facts["recipe"]["data"].get("audio")
    if audio is None:
        raise InputError(
            f"the run {str(folder)!r} was trained on all audio columns", "name data.audio in the recipe, and train again"
        )
    if not {"stretches", "speech"} <= set(arrays):
        raise InputError(f"{EXAMPLES} of {str(folder)!r} is of another version", "train it again")
    store = facts["store"]
    if style is not None and style not in store["speakers"]:
        raise InputError(f"no speaker of the run is called {style!r}", nearest(style, store["speakers"]))
    styles = [*store["speakers"], *([VOICE] if model.estimates_speaker else [])]
    manifest = {
        "model": facts["model"], "config": facts["config"], "corpus": store["corpus"], "train_seconds": store["train_seconds"],
        "styles": styles, "style": style or (VOICE if VOICE in styles else styles[0]), "pose": store["pose"],
        "fps": float(store["fps"]), "audio": audio, "smooth": smooth, "controls": list(model.controls),
        "rests": rests, "emotion_strength": dict(emotion_strength or {}),
    }  # fmt: skip
    text = card or _card(facts, early=stands_for(folder, which) != which)
    if export is None:
        bundle_flow(target, model, arrays, small=small, facts=manifest, progress=progress, card=text)
    else:
        _bundle_networks(target, model, export, arrays, small=small, facts=manifest, card=text, progress=progress)


def _bundle_networks(
    path: Path, model: Any, export: ExportedModel, arrays: Mapping[str, Array], *, small: bool, facts: dict[str, Any],
    card: str, progress: Tell | None,
) -> None:  # fmt: skip
    """Calibrate networks on the motion that they play, and write them."""
    if "pose_spread" in arrays:
        hint = "only flows can; set data.per_clip_normalisation = false and train again"
        raise InputError(f"a run of {facts['model']!r} with per_clip_normalisation cannot become a bundle", hint)
    if export.words.size and "texts" not in arrays:
        raise InputError(f"the run of {facts['model']!r} is of another version", "train it again")
    codes = model.speaker_styles(torch.from_numpy(arrays["stretches"])).numpy()
    space, statistics = _style_space(codes), _statistics(model, export, arrays, codes)
    statistics = _add_label_styles(model, statistics, facts)
    weights, exact = export.weights, _players(export, export.weights)
    columns = len(model.controls)
    if not model.literal:
        measures = space == "speaker-emotion"
        statistics = calibrate(
            exact, statistics, arrays, facts["fps"], columns=columns, measures_noise=measures, progress=progress
        )
    if small:
        if progress is not None:
            progress(1, 1, "rounding the weights")
        weights = half(weights)
        rows, approximate = stretch_rows(statistics, arrays, columns)[:, 0], _players(export, unpack_half(weights))
        facts |= {"rounding": _rounding(exact, approximate, rows, statistics.style_codes)}
        card += f"\nWeights are kept in half precision, which moves its poses by {facts['rounding']:.2%} of their size.\n"
    if space in ("one-hot", "speaker-emotion"):
        statistics = replace(statistics, style_codes=np.zeros(0, np.float32))
    facts |= {"style_space": space}
    write_networks(path, export.signatures, export.graphs, weights, statistics, facts=facts, card=card)


def _players(export: ExportedModel, weights: Mapping[str, Array]) -> dict[str, Network]:
    """The opened networks that make poses, and those that draw the latents of poses."""
    return {
        name: Network(signature, export.graphs[name], weights)
        for name, signature in export.signatures.items() if name not in ("style", "classify")
    }  # fmt: skip


def _rounding(exact: Mapping[str, Network], approximate: Mapping[str, Network], rows: Array, styles: Array) -> float:
    """Relative error of the poses with approximate weights; where latents are drawn, with those of the exact networks."""
    if "hear" not in exact:
        name = "make" if "make" in exact else "live"
        return relative_error(exact[name], approximate[name], rows, styles)
    sampler, draws = open_sampler(exact), []
    for own, style in zip(rows[:, : exact["make"].signature.probe], styles, strict=False):
        features = exact["hear"].run(rows=own[None])["heard"]
        noise = sampler.draw_noise([0], np.arange(features.shape[1]))
        draws.append(sampler.draw(features, np.broadcast_to(style, (1, features.shape[1], len(style))), noise, None, 1.0))
    return difference((make["make"].run(latent=each)["poses"] for make in (exact, approximate)) for each in draws)


def _add_label_styles(model: Any, statistics: Statistics, facts: dict[str, Any]) -> Statistics:
    """Statistics with the named styles that a network has beside its speakers; a speaker of the same name comes first."""
    codes = {name: code.numpy() for name, code in model.label_styles().items() if name not in facts["styles"]}
    facts["styles"] = [*facts["styles"], *codes]
    mean = statistics.speaker_mean
    return replace(
        statistics, style_codes=np.concatenate([statistics.style_codes, *(code[None] for code in codes.values())]),
        speaker_mean=np.concatenate([mean, np.repeat(mean.mean(0, keepdims=True), len(codes), 0)]),
    )  # fmt: skip


def _style_space(codes: Array) -> str:
    """The space of the styles (S, C) of the speakers, one of `cospeech.runtime.bundles.spec.STYLE_SPACES`."""
    speakers, width = codes.shape
    alone = np.eye(speakers, width)
    if width == speakers + len(EMOTIONS):
        alone[:, speakers] = 1  # neutral
        return "speaker-emotion" if (codes == alone).all() else "code"
    return "none" if not width else "one-hot" if width == speakers and (codes == alone).all() else "code"


def _statistics(model: Any, export: ExportedModel, arrays: Mapping[str, Array], codes: Array) -> Statistics:
    """Statistics of the run, with a style code for each speaker."""
    codes = codes[:, : len(codes)] if _style_space(codes) == "speaker-emotion" else codes
    own = {f.name: arrays[f.name] for f in fields(Statistics)[:8]} | {"speaker_mean": arrays["pose_centre"]}
    own |= {"style_codes": codes, "words": export.words}
    if model.controls:
        own["control_quantiles"] = control_quantiles(model, arrays)
    return Statistics(**{name: np.ascontiguousarray(value, np.float32) for name, value in own.items()})


def _card(facts: dict[str, Any], *, early: bool) -> str:
    """The facts of a run as a card; early: whether it stopped before its first validation."""
    store = facts["store"]
    return (
        f"# {facts['model']}\n\nTrained on {store['train_seconds'] / 3600:.2f} h of {store['corpus']} "
        f"({len(store['speakers'])} speakers, {store['pose']}, {store['fps']:g} frames per second).\n"
        + ("\nThe last parameters, not the best: the run stopped before its first validation.\n" if early else "")
    )
