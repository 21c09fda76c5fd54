"""`make lock`: resolve the dependencies, and write the lists for pip that are made from the lock.

``requirements/core.txt`` is what `make demo` installs (the core, video, and the build backend, every file with its hash):
pip alone can read it, which spares newcomers the download of uv. ``requirements/studio.txt`` has the extra ``studio`` in
addition, for `make studio`. ``requirements/node.txt`` has the Node that builds the studio where the machine has none. A test
holds all three in step with ``uv.lock``.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
UV = Path(sys.executable).parent / "uv"

EXPORT = "export --quiet --frozen --no-dev --extra av --group build --no-emit-project --no-annotate --no-header"
STUDIO = "export --quiet --frozen --no-dev --extra studio --group build --no-emit-project --no-annotate --no-header"
NODE = "export --quiet --frozen --only-group node --no-emit-project --no-annotate --no-header"
BLENDER = "pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-annotate --no-header"


def main() -> None:
    subprocess.run([UV, "lock"], cwd=ROOT, check=True)
    subprocess.run([UV, *EXPORT.split(), "-o", "requirements/core.txt"], cwd=ROOT, check=True)
    subprocess.run([UV, *STUDIO.split(), "-o", "requirements/studio.txt"], cwd=ROOT, check=True)
    subprocess.run([UV, *NODE.split(), "-o", "requirements/node.txt"], cwd=ROOT, check=True)
    subprocess.run([UV, *BLENDER.split(), "requirements/blender.in", "-o", "requirements/blender.txt"], cwd=ROOT, check=True)


if __name__ == "__main__":
    main()
