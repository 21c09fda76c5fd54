"""Sculpt the mannequin and keep it as a file of the package.

    python tools/build_mannequin.py
"""

from pathlib import Path

from cospeech import mannequin
from cospeech.mannequin import asset

if __name__ == "__main__":
    target = Path(__file__).parents[1] / "src" / "cospeech" / "assets" / "mannequin.npz"
    character = mannequin.sculpt()
    asset.save(character, target)
    triangles = sum(len(p.triangles) for p in character.parts)
    vertices = sum(len(p.vertices) for p in character.parts)
    print(f"{target.name}: {len(character.parts)} parts, {vertices} vertices, {triangles} triangles, {target.stat().st_size} bytes")
