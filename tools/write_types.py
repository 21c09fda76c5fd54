"""Write web/src/messages.ts: the types of the studio's messages, made from the models of `cospeech.studio.messages` and
`cospeech.studio.live_messages`.

The page and the server cannot disagree about a message: tests/studio/test_types.py says when the file is stale. The page's
requests may leave out what has a default; the server's answers always have all fields.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from pydantic import BaseModel, TypeAdapter

from cospeech.studio import live_messages, messages

TARGET = Path(__file__).resolve().parents[1] / "web" / "src" / "messages.ts"
HEAD = "// Made by `python tools/write_types.py` from src/cospeech/studio/messages.py and live_messages.py: do not edit.\n"
REQUESTS = (messages.TakeRequest, messages.PlanEditRequest, messages.PlanOpenRequest, live_messages.LiveMessage)
_SIMPLE = {"string": "string", "number": "number", "integer": "number", "boolean": "boolean", "null": "null"}


def collect_schemas() -> dict[str, dict[str, Any]]:
    """Name → JSON schema of every message and of every part of one, requests as they may be sent."""
    schemas: dict[str, dict[str, Any]] = {}
    for request in REQUESTS:
        _take(schemas, TypeAdapter(request).json_schema(mode="validation"))
    for kind in (getattr(module, name) for module in (messages, live_messages) for name in module.__all__):
        if isinstance(kind, type) and issubclass(kind, BaseModel) and kind.model_fields and kind.__name__ not in schemas:
            _take(schemas, kind.model_json_schema(mode="serialization"), complete=True)
    return dict(sorted(schemas.items()))


def _take(schemas: dict[str, dict[str, Any]], schema: dict[str, Any], *, complete: bool = False) -> None:
    parts = dict(schema.get("$defs", {}))
    if schema.get("type") == "object":
        parts[schema["title"]] = schema
    for name, part in parts.items():
        extra = {"required": [*part.get("properties", {})]} if complete else {}
        schemas.setdefault(name, part | extra)


def write_type(schema: dict[str, Any]) -> str:
    """A TypeScript type that holds the same values as a JSON schema, as far as types can say."""
    if "$ref" in schema:
        return str(schema["$ref"].rsplit("/", 1)[-1])
    if "const" in schema:
        return _literal(schema["const"])
    if "enum" in schema:
        return " | ".join(_literal(value) for value in schema["enum"])
    for key in ("anyOf", "oneOf"):
        if key in schema:
            return " | ".join(dict.fromkeys(write_type(part) for part in schema[key]))
    kind = schema.get("type")
    if kind == "array" and "prefixItems" in schema:
        return f"[{', '.join(write_type(part) for part in schema['prefixItems'])}]"
    if kind == "array":
        inner = write_type(schema["items"])
        return f"({inner})[]" if " | " in inner else f"{inner}[]"
    if kind == "object":
        return f"Record<string, {write_type(schema['additionalProperties'])}>"
    return _SIMPLE.get(str(kind), "unknown")


def _literal(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value).lower()


def write_interface(name: str, schema: dict[str, Any]) -> str:
    """An exported interface, with the first lines of the docstrings as comments."""
    lines = [f"/** {_first_line(schema)} */"] if schema.get("description") else []
    lines.append(f"export interface {name} {{")
    for field, part in schema.get("properties", {}).items():
        optional = "" if field in schema.get("required", ()) else "?"
        lines.append(f"  {field}{optional}: {write_type(part)};")
    return "\n".join([*lines, "}"])


def _first_line(schema: dict[str, Any]) -> str:
    text: str = schema["description"].split("\n\n")[0].replace("\n", " ")
    return text.replace("``", "`").replace("*/", "* /")


def write_messages() -> str:
    """The whole file."""
    return "\n\n".join([HEAD.rstrip(), *(write_interface(name, schema) for name, schema in collect_schemas().items())]) + "\n"


def main() -> int:
    """Write the file; with ``--check``, only say whether it is stale."""
    text = write_messages()
    if "--check" in sys.argv[1:]:
        stale = not TARGET.is_file() or TARGET.read_text("utf-8") != text
        print(f"{TARGET.name} is stale: run python tools/write_types.py" if stale else f"{TARGET.name} is as the models are")
        return int(stale)
    TARGET.write_text(text, "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
