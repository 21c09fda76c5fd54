"""`make studio`: builds the page of the studio and the viewer of share files into src/cospeech/assets/studio/.

Node comes from the machine where that is recent enough, else from its PyPI wheel. Nothing is built again while the sources are
unchanged.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import check
import write_types

WEB = check.ROOT / "web"
BUILT = check.ROOT / "src" / "cospeech" / "assets" / "studio"


def digest_sources() -> str:
    """SHA-256 of all files that the build reads."""
    files = [*(WEB / "src").rglob("*"), *(WEB / "public").rglob("*"), *WEB.glob("*.*")]
    total = hashlib.sha256()
    for path in sorted(file for file in files if file.is_file()):
        total.update(path.relative_to(WEB).as_posix().encode() + b"\0" + path.read_bytes())
    return total.hexdigest()


def main() -> int:
    """Install, check the types, build twice: the page, then the viewer."""
    stamp = WEB / "node_modules" / ".built-from"
    digest = digest_sources()
    if stamp.is_file() and stamp.read_text("utf-8") == digest and (BUILT / "viewer.js").is_file():
        print("the studio is built already")
        return 0
    if write_types.TARGET.read_text("utf-8") != write_types.write_messages():
        raise SystemExit("web/src/messages.ts is stale (python tools/write_types.py)")
    node, npm = check.node()
    check.install_packages(WEB, npm)
    modules = WEB / "node_modules"
    vite = [node, modules / "vite" / "bin" / "vite.js", "build", "--logLevel", "warn"]
    for command in ([node, modules / "typescript" / "bin" / "tsc", "--noEmit"], vite, [*vite, "--mode", "share"]):
        if not check.run(*command, cwd=WEB, env=os.environ | {"NO_COLOR": "1"}):
            return 1
    stamp.write_text(digest, "utf-8")
    size = sum(path.stat().st_size for path in BUILT.rglob("*") if path.is_file())
    print(f"the studio is built: {Path(BUILT).relative_to(check.ROOT)}, {size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
