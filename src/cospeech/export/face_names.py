"""Names of the shapes of faces: ARKit's, VRM's presets, and Oculus' visemes.

`cospeech.export.face_rig` reads characters by these tables; the page of the studio gets them from the server, and reads its
characters in the same way (web/src/face_rig.ts).
"""

from __future__ import annotations

from ..motion.skeletons.arkit import ARKIT

__all__ = ["ARKIT_NAMES", "ENOUGH", "HELD", "LONGEST", "MOVED", "OCULUS_NAMES", "VRM0_NAMES"]

LONGEST = 64
"""Letters at the end of a name that count. [ours]: the longest of ARKit has 19."""
ENOUGH = 12
"""How many of ARKit's shapes a face needs; [ours]: with fewer, a full set of presets or visemes says more."""
HELD = 0.3
"""Weight of an eye bone from which a vertex is part of the eyeball. [ours]: lids at the corner of an eye have less."""
MOVED = 1e-3
"""Metres by which a vertex of an eyeball moves in a shape that turns it. [ours]: lids push an eyeball by less."""

_SHORT = {name.replace("Left", "L").replace("Right", "R").lower(): name for name in ARKIT if name.endswith(("Left", "Right"))}
ARKIT_NAMES = {name.lower(): name for name in ARKIT} | _SHORT
"""Small letters without signs → the name of ARKit: ``eyeblinkleft`` and ``eyeblinkl`` → ``eyeBlinkLeft``."""
VRM0_NAMES = {
    "a": "aa", "i": "ih", "u": "ou", "e": "ee", "o": "oh", "blink": "blink", "blink_l": "blinkLeft", "blink_r": "blinkRight",
    "lookup": "lookUp", "lookdown": "lookDown", "lookleft": "lookLeft", "lookright": "lookRight",
    "joy": "happy", "angry": "angry", "sorrow": "sad", "surprised": "surprised",
}  # fmt: skip
"""Preset of VRM 0.x in small letters → the preset of VRM 1.0."""
OCULUS_NAMES = {name.lower(): name for name in ("sil", "PP", "FF", "aa", "E", "I", "O", "U")}
"""The text after ``viseme_``, in small letters → the viseme of Oculus, for those that are driven."""
