"""Metrics, one file each. They use numpy and scipy (of the extra ``corpora``) only, and no module here imports a model.

Every row of `METRICS` is called in the same way:

    score = metric(generated, reference, tools)

``generated`` and ``reference`` are sequences of `Sample`: positions, key points, rotations, track, speech and semantics, as far
as a recording has them. `Tools` holds what the caller passes in: a named feature network, a classifier, centres. The result is
a `Score`: a value, its 95 % interval and its count. ``metric.about`` says what the metric needs, which way is better, whether
it pairs clips and whether it hears the speech. A metric with a paper or a system in its name computes what that code computes,
quirks included. The others are the defaults: they correct the faults of the published forms.

`movement` measures how people move. `beat_lift` measures how far motion follows the accents of its speech, corrected for
chance. `controls` builds the control rows that every table needs.
"""

from .beat_lift import BeatLift, beat_lift
from .metric import Metric
from .movement import Track, movement_statistics
from .movement_reference import REFERENCE, ReferenceRow
from .sample import FeatureNet, Sample, Score, Tools

__all__ = [
    "METRICS", "REFERENCE", "BeatLift", "FeatureNet", "Metric", "ReferenceRow", "Sample", "Score", "Tools", "Track",
    "beat_lift", "load_metric", "movement_statistics",
]  # fmt: skip

_ROWS = {
    "movement_share": ("movement",),
    "beat_align": ("beat_align", "beat_align_gfge", "beat_align_ha2g", "beat_align_beat"),
    "fgd": ("fgd", "fgd_published", "fid_poses"),
    "pck": ("pck", "pck_gfge", "pck_2d", "pck_mix_stage", "pck_s2g"),
    "joint_error": ("mae", "ape", "acceleration_error"),
    "srgr": ("srgr", "srgr_beat"),
    "mode_f1": ("mode_f1", "mode_f1_published"),
    "diversity": ("diversity", "diversity_gfge", "diversity_mix_stage", "l1_div", "l1_div_beat"),
    "multimodality": ("multimodality", "multimodality_ha2g"),
    "clustering": ("chi", "silhouette", "chi_gfge", "silhouette_gfge"),
    "inception_score": ("inception_score", "inception_score_published"),
    "wasserstein": ("w1_speed", "w1_acceleration", "w1_speed_mix_stage"),
    "genea": ("jerk", "acceleration", "jerk_genea", "hellinger_speed", "hellinger_speed_genea"),
    "cca": ("cca", "cca_genea"),
    "face_mse": ("face_mse",),
    "lip_closure": ("lip_closure", "lip_closure_agreement"),
    "jaw_lag": ("jaw_lag", "jaw_correlation"),
    "blinks": ("blinks", "blink_rate", "blink_duration", "blink_gaps"),
}
"""Module (and page of the documentation) → its metrics."""

METRICS: dict[str, str] = {name: f"cospeech.metrics.{module}:{name}" for module, names in _ROWS.items() for name in names}
"""Name → ``module:function`` of the one signature; `cospeech list metrics`, `evaluate` and the docs iterate over it."""


def load_metric(name: str) -> Metric:
    """A metric by name.

    Raises:
        InputError: no metric has this name, or the registered object is no metric.
    """
    from ..errors import InputError, find_attribute, nearest

    if name not in METRICS:
        raise InputError(f"no metric is called {name!r}", nearest(name, METRICS))
    module, _, attribute = METRICS[name].partition(":")
    entry = find_attribute(module, attribute, f"the metric {name!r} cannot be used", f"METRICS says {METRICS[name]!r}")
    if not isinstance(entry, Metric):
        raise InputError(f"the metric {name!r} is a {type(entry).__name__}", "put @metric(…, better=…) before the function")
    return entry
