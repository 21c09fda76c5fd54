"""``cospeech bundle``: what a run has learnt → one file that plays without PyTorch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, nearest
from ...motion.poses.controls import CONTROLS
from ...motion.rotations import Array
from ...runtime.network import Network
from ...runtime.signature import Signature
from ...runtime.spec import VOICE, half, unpacked
from ...runtime.statistics import Statistics
from ...runtime.system import write_networks
from ..checkpoint import load_run, read_facts, read_tensors, stands_for
from .calibration import calibrate, relative_error, stretch_rows
from .flow import bundle_flow, control_quantiles

__all__ = ["EXAMPLES", "bundle_run"]

EXAMPLES = "examples.safetensors"
"""Of a run folder: what `cospeech.training.calibration_clips.examples_of` took from the store."""


def bundle_run(
    run: str | PathLike[str],
    path: str | PathLike[str],
    *,
    which: str = "best",
    small: bool = True,
    smooth: int = 1,
    card: str = "",
    style: str | None = None,
) -> None:
    """Make a bundle of a run.

    Args:
        run: folder made by `cospeech.training.train.train`.
        path: file to write, ``NAME.cospeech``.
        which: "best" or "last" parameters; see `cospeech.training.checkpoint.load_run` for a run that has no best.
        small: keep weights in fewer bits: the large products of flows in 8, all weights of other networks in 16; the manifest and
            the card then say by how much that moves poses (``rounding``).
        smooth: frames to either side over which poses are averaged (binomial weights).
        card: Markdown; what is known of the run, where not given.
        style: name of the speaker whose style is played where nobody says; where not given, the one that is heard in the voice,
            of a network that hears none the first.

    Raises:
        InputError: not a run, or of a system that has no bundles.
    """
    target = Path(path)
    if target.suffix != ".cospeech":
        raise InputError(f"a bundle called {str(target)!r}", "its name ends in .cospeech")
    folder = Path(run)
    facts = read_facts(folder)
    model: Any = load_run(folder, which)[0]
    ...
