"""Converts bundles of format 1, which had three kinds of networks by their sizes, to today's format: the motion is the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from os import PathLike, fsdecode
from pathlib import Path
from typing import Any

import numpy as np

from ...audio.emotions import EMOTIONS
from ...errors import InputError
from ...motion.rotations import Array
from ..network import open_session
from ..system import open_system
from .bundle import Bundle, pack_arrays, read_bundle, write_bundle
from .signature import STYLE_FRAMES, Port, Signature
from .spec import STATISTICS, WEIGHTS, read_spec, unpack_half

__all__ = ["NAMES", "SIZES", "convert_bundle"]

NAMES = {
    "flow": {"styles": "style_codes", "centres": "speaker_mean", "spreads": "speaker_std", "made_mean": "free_mean",  # old name
             "made_std": "free_std", "controls": "control_quantiles"},  # old name
    "window": {"centres": "speaker_mean", "codes": "style_codes", "made": "model_mean", "gains": "style_gain"},
    "chain": {"centres": "speaker_mean", "made": "model_mean", "gains": "style_gain",
              "live_made": "live_model_mean",  # old name
              "live_gains": "live_style_gain", "strays": "noise_gain"},  # old name
}  # fmt: skip
"""Kind of format 1 → its names of statistics, and today's."""
SIZES = {"pull": "feedback_gain", "heard": "speech_frames"}
"""Sizes of a flow."""
_NOISE = b"nudge", b"noise"  # old name


def convert_bundle(path: str | PathLike[str], out: str | PathLike[str]) -> None:
    """Write a bundle of format 1 as one of today's format.

    Args:
        path: the old file.
        out: the new one; ``NAME.cospeech``.

    Raises:
        InputError: it is no bundle of format 1, is damaged, or cannot be written.
    """
    if Path(fsdecode(out)).suffix != ".cospeech":
        raise InputError(f"a bundle cannot be called {fsdecode(out)!r}", "its name ends in .cospeech")
    old = read_bundle(path, format=1)
    kind, sizes = old.fact("kind", str), old.fact("sizes", dict)
    if kind not in NAMES:
        raise InputError(f"{old.name!r} is a bundle of kind {kind[:40]!r}", f"kinds that can be converted: {', '.join(NAMES)}")
    arrays = {NAMES[kind].get(name, name): value for name, value in old.arrays(STATISTICS).items() if value.size}
    manifest = {name: value for name, value in old.manifest.items() if name not in ("kind", "sizes", "members", "format")}
    members = {name: data.replace(*_NOISE) if name.endswith(".onnx") else data for name, data in old.members.items()}
    try:
        facts = {"flow": _flow, "window": _windows, "chain": _chain}[kind](sizes, arrays, old, _states(old))
    except (KeyError, TypeError, IndexError):
        raise InputError(f"{old.name!r} lacks entries of a bundle of format 1", "is it damaged?") from None
    if facts["style_space"] in ("one-hot", "speaker-emotion"):
        arrays.pop("style_codes", None)
    new = Bundle(old.name, manifest | facts, members | {STATISTICS: pack_arrays(arrays)})
    open_system(read_spec(new))
    write_bundle(out, new.manifest, new.members)


def _flow(sizes: Mapping[str, Any], arrays: Mapping[str, Array], old: Bundle, states: Mapping[str, Port]) -> dict[str, Any]:
    flow_sizes = {SIZES.get(name, name): size for name, size in sizes.items()}
    return {"flow": flow_sizes, "style_space": "code" if sizes.get("style") else "none"}


def _windows(sizes: Mapping[str, Any], arrays: Mapping[str, Array], old: Bundle, states: Mapping[str, Port]) -> dict[str, Any]:
    """A network without a memory."""
    codes = arrays.get("style_codes", np.zeros((0, 0)))
    one_hot = codes.shape[0] == codes.shape[1] > 0 and (codes == np.eye(len(codes))).all()
    ports: dict[str, Port] = {"rows": (1, "T", sizes["audio"])}
    ports |= {"style": ("N", "T", sizes["styles"])} if sizes["styles"] else {}
    ports |= {"noise": ("N", "T", sizes["modes"])} if sizes["modes"] else {}
    takes = "N" if len(ports) > 1 else 1
    make = Signature(
        ports, {"poses": (takes, "T", sizes["pose"])}, window=sizes["window"], multiple=sizes["multiple"], reach=sizes["reach"]
    )
    signatures = {"make": make}
    if "style.onnx" in old.members:
        signatures["style"] = Signature(
            {"poses": (1, "T", sizes["pose"])}, {"style": (1, sizes["styles"])}, window=STYLE_FRAMES
        )  # fmt: skip
    space = "one-hot" if one_hot else "code" if sizes["styles"] else "none"
    return {"networks": _plain(signatures), "style_space": space}


def _chain(sizes: Mapping[str, Any], arrays: Mapping[str, Array], old: Bundle, states: Mapping[str, Port]) -> dict[str, Any]:
    """A network of speakers and emotions, perhaps with a classifier, and one that plays frame by frame."""
    pose, style, window = sizes["pose"], sizes["speakers"] + len(EMOTIONS), sizes["window"]
    ports: dict[str, Port] = {"rows": (1, "T", sizes["audio"] + sizes["words"]), "style": ("N", "T", style)}
    ports |= {"noise": ("N", "T", sizes["noise"])} if sizes["noise"] else {}
    frame = Signature({name: (port[0], port[-1]) for name, port in ports.items()}, {"poses": ("N", pose)}, states)
    ports |= {"face": (1, "T", sizes["faces"] + 1)} if sizes.get("faces") else {}
    ports |= {"seed": (1, "T", pose + 1)} if sizes.get("seeds") else {}
    signatures = {"make": Signature(
        ports, {"poses": ("N", "T", pose)}, window=window, hop=max(1, window // 2), look_ahead=window // 4,
        seeds=sizes.get("seeds", 0),
    )}  # fmt: skip
    if "live.onnx" in old.members:
        signatures["live"] = replace(frame, look_ahead=sizes["look_ahead"])
    if "classify.onnx" in old.members:
        signatures["classify"] = Signature(
            {"rows": (1, "T", sizes["audio"])}, {"logits": (1, "T", style)}, window=2 * sizes["reach"] + 1, reach=sizes["reach"]
        )
    return {"networks": _plain(signatures), "style_space": "speaker-emotion"}


def _plain(signatures: Mapping[str, Signature]) -> dict[str, Any]:
    return {name: signature.to_dict() for name, signature in signatures.items()}


def _states(old: Bundle) -> dict[str, Port]:
    """State of the graph ``live`` → its shape; format 1 did not store it."""
    if "live.onnx" not in old.members:
        return {}
    inputs = open_session(old.members["live.onnx"].replace(*_NOISE), unpack_half(old.arrays(WEIGHTS))).get_inputs()
    return {end.name: (1 if end.shape[0] == 1 else "N", end.shape[1]) for end in inputs if end.name.startswith("state")}
