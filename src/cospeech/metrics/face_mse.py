"""Face MSE: the mean squared difference of ARKit weights to the recording (Chain of Generation, equation 7).

Said of one recording: one speech may be spoken with many faces, and the mean face does well. Frames that were given are left
out; channels that a corpus lacks are 0 on both sides (BEAT has no ``tongueOut``).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .interval import mean_score
from .metric import metric, pair_samples
from .sample import Sample, Score, Tools

__all__ = ["face_mse"]


@metric("face", better="lower", paired=True)
def face_mse(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mean (Δ weight)² of the 52 ARKit weights to the recording, without the seed frames."""
    pairs = pair_samples(generated, reference, "face")
    own = [(np.square(face - true)[sample.seed_frames :], sample.group) for sample, _, face, true in pairs]
    gaps, groups = [gap for gap, _ in own if len(gap)], [group for gap, group in own if len(gap)]
    return mean_score([float(gap.mean()) for gap in gaps], [float(len(gap)) for gap in gaps], groups=groups, seed=tools.seed)
