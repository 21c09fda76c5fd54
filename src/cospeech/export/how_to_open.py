"""Where each kind of file goes next: one line per suffix, printed after a run."""

__all__ = ["HOW_TO_OPEN"]

HOW_TO_OPEN = {
    ".bvh": "Blender: File > Import > Motion Capture (.bvh), Scale 0.01, tick Update Scene FPS; or MotionBuilder, Maya, iClone",
    ".glb": "Blender: File > Import > glTF 2.0; Windows: 3D Viewer; Unity, Unreal, Godot: drop it into the project",
    ".vrma": "play it on any VRM avatar: three-vrm, UniVRM, VRM add-on for Blender",
    ".csv": "Unreal: plugin Live Link Face Importer, then drop it into the Content Browser; Blender: Faceit",
    ".json": "52 ARKit weights per frame, for your own program",
    ".npz": "SMPL-X: numpy.load, or the SMPL-X add-on for Blender",
    ".mp4": "any video player",
    ".gif": "any web browser",
    ".png": "any picture viewer: a strip of frames over the waveform",
}
"""Suffix → where such a file goes; printed after each run, checked against the table of formats."""
