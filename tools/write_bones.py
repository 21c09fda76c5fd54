"""Write web/src/bone_tables.ts: the tables of bone names of `cospeech.motion.skeletons`, for the page's avatars."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path

from cospeech.motion.skeletons import SKELETONS

TARGET = Path(__file__).resolve().parents[1] / "web" / "src" / "bone_tables.ts"
HEAD = "// Made by `python tools/write_bones.py` from src/cospeech/motion/skeletons: do not edit.\n"


def write_tables() -> str:
    """The TypeScript file: one table (our joint → their bone) per naming, in the order in which Python tries them."""
    tables = [import_module(module).NAMES for module in SKELETONS.values()]
    lines = dict.fromkeys(f"  {json.dumps(table)}," for table in tables)
    return "\n".join([HEAD + "export const BONE_TABLES: Record<string, string>[] = [", *lines, "];", ""])


if __name__ == "__main__":
    TARGET.write_text(write_tables(), "utf-8", newline="\n")
