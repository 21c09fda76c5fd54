"""Tables of skeletons: names, parents, offsets. No logic lives here."""

__all__ = ["SKELETONS"]

SKELETONS: dict[str, str] = {
    "humanoid": "cospeech.skeletons.humanoid",
    "vrm": "cospeech.skeletons.vrm",
    "mixamo": "cospeech.skeletons.mixamo",
    "beat": "cospeech.skeletons.beat",
    "smplx": "cospeech.skeletons.smplx",
    "unreal": "cospeech.skeletons.unreal",
    "trinity": "cospeech.skeletons.trinity",
}
"""Name → module with ``JOINTS`` (name, parent, offset in metres), ``ENDS`` and ``NAMES`` (our joint's name → theirs).

`cospeech.skeleton.named_skeleton` builds one; command line, docs and tests iterate over this."""
