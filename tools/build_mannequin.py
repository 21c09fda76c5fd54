"""Sculpt the mannequin and keep it as a file of the package.

python tools/build_mannequin.py
"""

import hashlib
from pathlib import Path

from mannequin.modelling import sculpt

from cospeech.export.mannequin import asset
from cospeech.motion.skeleton import humanoid


def digest_sources() -> str:
    """SHA-256 of the code and the skeleton of the sculpture. A test compares it with that in the file: sculpting takes long."""
    digest = hashlib.sha256(humanoid().offsets.astype("<f8").tobytes())
    for path in sorted((Path(__file__).parent / "mannequin").glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


if __name__ == "__main__":
    target = Path(__file__).parents[1] / "src" / "cospeech" / "assets" / "mannequin.npz"
    character = sculpt()
    asset.save(character, target, digest_sources())
    counts = [(len(p.vertices), len(p.triangles)) for p in character.parts]
    vertices, triangles = (sum(column) for column in zip(*counts, strict=True))
    print(f"{target.name}: {len(counts)} parts, {vertices} vertices, {triangles} triangles, {target.stat().st_size} bytes")
