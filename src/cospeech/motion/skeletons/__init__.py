"""Tables of skeletons: names, parents, offsets. No logic lives here."""

__all__ = ["SKELETONS"]

SKELETONS: dict[str, str] = {
    "humanoid": "cospeech.motion.skeletons.humanoid",
    "vrm": "cospeech.motion.skeletons.vrm",
    "mixamo": "cospeech.motion.skeletons.mixamo",
    "beat": "cospeech.motion.skeletons.beat",
    "smplx": "cospeech.motion.skeletons.smplx",
    "unreal": "cospeech.motion.skeletons.unreal",
    "trinity": "cospeech.motion.skeletons.trinity",
}
"""Name → module with ``JOINTS`` (name, parent, offset in metres), ``ENDS`` and ``NAMES`` (our joint's name → theirs).

`cospeech.motion.skeleton.find_skeleton` builds one; command line, docs and tests iterate over this."""
