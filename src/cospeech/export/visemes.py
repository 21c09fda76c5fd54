"""From ARKit's 52 weights to the smaller alphabets of other characters: VRM's presets and Oculus' visemes.

With ``A`` = how open the mouth is (jawOpen less mouthClose, over 0.4: speech seldom opens ARKit's jaw further), ``R`` = how
round (the larger of mouthPucker and mouthFunnel, over 0.7), ``W`` = how wide (stretch over 0.22, for speech seldom stretches
lips further; more by a smile beyond 0.2, over 0.8; less R), ``L`` = whether the lips are parted (the larger of A and of twice
the lips' mean lift), each held in 0 … 1:

    aa = (1−R)·A·(1−W)    ee = (1−R)·A·W    ih = (1−R)·(1−A)·W·L    oh = R·A    ou = R·(1−A)

They never add up to more than 1, a smile with closed lips is no vowel, and a wide open jaw is ``aa``. The formula and its six
scales are ours. ``blink`` is the weight that both lids share, and ``blinkLeft``/``blinkRight`` are the rest, because a
character adds them up.

The moods are sums of ARKit weights, held in 0 … 1 (`MOODS`). A face that speaks without an emotion stays below their
thresholds. VRM has no preset for fear, disgust and contempt: fear shows as surprise, disgust as anger. The page of the studio
gets `MOODS`, `OCULUS_VOWELS` and `SCALES` from the server; web/src/face_drivers.ts has the formula, and a test compares.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX

__all__ = ["MOODS", "OCULUS_VOWELS", "SCALES", "arkit_from_presets", "invert_presets", "oculus_visemes", "vrm_presets"]

SCALES = {"open": 0.4, "round": 0.7, "stretched": 0.22, "smiled": 0.8, "parted": 0.5, "at_ease": 0.2}
"""Of the formula above. [ours]; ``at_ease``: a face that speaks without an emotion smiles less for nine tenths of the time."""
_OPEN, _ROUND, _STRETCH, _SMILE, _PARTING, _AT_EASE = SCALES.values()
_LITTLE, _TRACE = 1e-3, 0.1  # ours: a weight below is none; a mood below may be an error of reading
_INVERSION_ORDER = ("surprised", "angry", "sad", "happy")  # moods, each after those whose shapes lower it
OCULUS_VOWELS = {"aa": "aa", "E": "ee", "I": "ih", "O": "oh", "U": "ou"}
"""Viseme of Oculus → the preset of VRM that is the same vowel."""
MOODS = {
    "happy": (-0.4, {"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8}),
    "angry": (-0.2, {"browDownLeft": 0.425, "browDownRight": 0.425, "browInnerUp": -0.7}),
    "sad": (-0.1, {"mouthFrownLeft": 0.6, "mouthFrownRight": 0.6, "browDownLeft": -0.25, "browDownRight": -0.25}),
    "surprised": (-0.25, {"eyeWideLeft": 0.4, "eyeWideRight": 0.4, "browInnerUp": 0.2}),
}
"""Mood of VRM → what is added to a sum of ARKit weights, and their shares. Ours: at the usual intensity, the preset of an
emotion is half of what the avatar's author drew, so that lips still speak."""
_FROM_PRESET = {
    "aa": {"jawOpen": 0.4},
    "ih": {"jawOpen": 0.1, "mouthStretchLeft": 0.5, "mouthStretchRight": 0.5, "mouthLowerDownLeft": 0.3,
           "mouthLowerDownRight": 0.3},
    "ou": {"mouthPucker": 0.7, "jawOpen": 0.05},
    "ee": {"jawOpen": 0.3, "mouthStretchLeft": 0.5, "mouthStretchRight": 0.5},
    "oh": {"jawOpen": 0.3, "mouthFunnel": 0.7},
    "blink": {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0},
    "blinkLeft": {"eyeBlinkLeft": 1.0},
    "blinkRight": {"eyeBlinkRight": 1.0},
    "happy": {"mouthSmileLeft": 0.7, "mouthSmileRight": 0.7, "cheekSquintLeft": 0.4, "cheekSquintRight": 0.4},
    "angry": {"browDownLeft": 0.8, "browDownRight": 0.8, "mouthFrownLeft": 0.3, "mouthFrownRight": 0.3},
    "sad": {"browInnerUp": 0.7, "mouthFrownLeft": 0.6, "mouthFrownRight": 0.6},
    "surprised": {"browInnerUp": 0.6, "browOuterUpLeft": 0.6, "browOuterUpRight": 0.6, "eyeWideLeft": 0.6, "eyeWideRight": 0.6},
}  # fmt: skip


def _mean(face: Array, *stems: str) -> Array:
    columns = [ARKIT_INDEX[stem + side] for stem in stems for side in ("Left", "Right")]
    return face[:, columns].mean(1)


def vrm_presets(face: Array) -> dict[str, Array]:
    """VRM 1.0's presets of mouth, lids, looks and moods, of ARKit weights ``(T, 52)``: name → (T,) in 0 … 1."""
    get = {name: face[:, k] for name, k in ARKIT_INDEX.items()}
    opening = np.clip((get["jawOpen"] - get["mouthClose"]) / _OPEN, 0, 1)
    rounding = np.clip(np.maximum(get["mouthPucker"], get["mouthFunnel"]) / _ROUND, 0, 1)
    smile = np.maximum(_mean(face, "mouthSmile") - _AT_EASE, 0) / _SMILE
    wide = np.clip(_mean(face, "mouthStretch") / _STRETCH + smile - rounding, 0, 1)
    lift = _mean(face, "mouthLowerDown", "mouthUpperUp") / _PARTING
    parting = np.clip(np.maximum(opening, lift), 0, 1)
    both = np.minimum(get["eyeBlinkLeft"], get["eyeBlinkRight"])
    moods = {
        mood: np.clip(base + sum(share * get[name] for name, share in shares.items()), 0, 1)
        for mood, (base, shares) in MOODS.items()
    }
    return moods | {
        "aa": (1 - rounding) * opening * (1 - wide),
        "ih": (1 - rounding) * (1 - opening) * wide * parting,
        "ou": rounding * (1 - opening),
        "ee": (1 - rounding) * opening * wide,
        "oh": rounding * opening,
        "blink": both,
        "blinkLeft": get["eyeBlinkLeft"] - both,
        "blinkRight": get["eyeBlinkRight"] - both,
        "lookUp": _mean(face, "eyeLookUp"),
        "lookDown": _mean(face, "eyeLookDown"),
        "lookLeft": (get["eyeLookOutLeft"] + get["eyeLookInRight"]) / 2,
        "lookRight": (get["eyeLookInLeft"] + get["eyeLookOutRight"]) / 2,
    }


def oculus_visemes(face: Array) -> dict[str, Array]:
    """The Oculus visemes that lip shapes alone can show: five vowels, PP, FF and sil; name → (T,) in 0 … 1."""
    vowels = vrm_presets(face)
    shut = 1 - np.clip((face[:, ARKIT_INDEX["jawOpen"]] - face[:, ARKIT_INDEX["mouthClose"]]) / _OPEN, 0, 1)
    upper, lower = face[:, ARKIT_INDEX["mouthRollUpper"]], face[:, ARKIT_INDEX["mouthRollLower"]]
    weights = {oculus: vowels[vrm] for oculus, vrm in OCULUS_VOWELS.items()}
    weights["FF"] = shut * np.clip(lower - upper, 0, 1)  # the lower lip under the teeth
    weights["PP"] = shut * np.maximum(_mean(face, "mouthPress"), np.minimum(upper, lower))
    room = np.maximum(sum(weights.values()), 1)
    weights = {name: weight / room for name, weight in weights.items()}
    return weights | {"sil": np.maximum(1 - sum(weights.values()), 0)}


def arkit_from_presets(presets: dict[str, Array]) -> Array:
    """ARKit weights ``(T, 52)`` that look like VRM presets (name → (T,)): for clips without ARKit's own expressions."""
    frames = len(next(iter(presets.values())))
    face = np.zeros((frames, len(ARKIT)))
    for preset, weight in presets.items():
        for name, share in _FROM_PRESET.get(preset, {}).items():
            face[:, ARKIT_INDEX[name]] += share * weight
    return np.clip(face, 0, 1)


def invert_presets(presets: Mapping[str, Array], frames: int) -> Array:
    """ARKit weights ``(T, 52)`` whose `vrm_presets` of mouth and moods are these again (name → (T,), 0 where not given).

    Shapes that no preset gives do not move: a smile that is no mood, which lip is round, a raised brow.
    """
    get = {name: np.clip(presets.get(name, np.zeros(frames)), 0, 1) for name in (*OCULUS_VOWELS.values(), *MOODS)}
    opening, rounding = np.clip(get["aa"] + get["ee"] + get["oh"], 0, 1), np.clip(get["oh"] + get["ou"], 0, 1)
    spread, apart = (1 - rounding) * opening, (1 - rounding) * (1 - opening)
    wide = np.clip(
        np.where(spread > _LITTLE, get["ee"] / np.maximum(spread, _LITTLE), get["ih"] / np.maximum(apart, _LITTLE)), 0, 1
    )
    parting = np.clip(get["ih"] / np.maximum(apart * wide, _LITTLE), 0, 1)
    face = np.zeros((frames, len(ARKIT)))
    for mood in _INVERSION_ORDER:
        base, shares = MOODS[mood]
        own = {name: share for name, share in shares.items() if share > 0}
        others = base + sum(share * face[:, ARKIT_INDEX[name]] for name, share in shares.items() if share < 0)
        weight = (get[mood] - others) / sum(own.values()) * np.minimum(get[mood] / _TRACE, 1)
        face[:, [ARKIT_INDEX[name] for name in own]] = np.clip(weight, 0, 1)[:, None]
    smile = np.maximum(_mean(face, "mouthSmile") - _AT_EASE, 0) / _SMILE
    lift = _PARTING * parting * (parting > opening)
    shapes = {
        "jawOpen": _OPEN * opening, "mouthPucker": _ROUND * rounding,
        "mouthStretch": _STRETCH * (wide + rounding - smile) * (wide > 0), "mouthLowerDown": lift, "mouthUpperUp": lift,
    }  # fmt: skip
    for stem, weight in shapes.items():
        for name in (stem, f"{stem}Left", f"{stem}Right"):
            if name in ARKIT_INDEX:
                face[:, ARKIT_INDEX[name]] = np.clip(weight, 0, 1)
    return face
