"""Sculpt the mannequin and keep it as a file of the package.

python tools/build_mannequin.py
"""

from pathlib import Path

from mannequin.modelling import sculpt

from cospeech.export.mannequin import asset

if __name__ == "__main__":
    target = Path(__file__).parents[1] / "src" / "cospeech" / "assets" / "mannequin.npz"
    character = sculpt()
    asset.save(character, target)
    counts = [(len(p.vertices), len(p.triangles)) for p in character.parts]
    vertices, triangles = (sum(column) for column in zip(*counts, strict=True))
    print(f"{target.name}: {len(counts)} parts, {vertices} vertices, {triangles} triangles, {target.stat().st_size} bytes")
