"""Packs the Blender add-on: `make blender` writes dist/cospeech-blender.zip. The same files give the same bytes."""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "blender" / "cospeech"
TARGET = ROOT / "dist" / "cospeech-blender.zip"
FILES = ("__init__.py", "blender_manifest.toml", "bvh.py", "errors.py", "rig.py")


def build(target: Path = TARGET) -> Path:
    """Write the zip."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in FILES:
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), (SOURCE / name).read_bytes(), zipfile.ZIP_DEFLATED)
        archive.writestr(
            zipfile.ZipInfo("LICENSE", (1980, 1, 1, 0, 0, 0)), (ROOT / "LICENSE").read_bytes(), zipfile.ZIP_DEFLATED
        )
    return target


if __name__ == "__main__":
    print(build(Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET))
