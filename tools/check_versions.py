"""`make versions`: runs the quick tests with the lowest versions of the dependencies that pyproject.toml allows, or the newest.

`make test` tests the versions of uv.lock alone. But `pip install cospeech` leaves an older package in place where
pyproject.toml allows it, and takes the newest of a package that is not there. The extras `av`, `corpora`, `live` and `studio`
are installed, and onnx, which makes the graphs of some tests; torch is not. The tools that test have their newest versions.

The environment is ``.venv-versions``; it is made anew each time, from the package index. Not part of `make test`.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys

import check

VENV = check.ROOT / ".venv-versions"
EXTRAS = ("av", "corpora", "live", "studio")
WARNING_OPTIONS = {"lowest": ["-W", "ignore::DeprecationWarning"], "newest": []}  # old packages warn of Python itself


def main() -> int:
    """Resolve, install, test."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("which", choices=("lowest", "newest"))
    parser.add_argument("--python", default=sys.executable, help="the Python to test with (default: this one)")
    parser.add_argument("tests", nargs="*", help="files of tests (default: all)")
    arguments = parser.parse_intermixed_args()
    uv, python, lists = check.BIN / "uv", VENV / check.PYTHON, VENV / "lists"
    shutil.rmtree(VENV, ignore_errors=True)
    if not check.run(uv, "venv", "--quiet", "--python", arguments.python, VENV):
        return 2
    lists.mkdir()
    ours, tools = lists / "ours.txt", lists / "tools.txt"
    (lists / "onnx.in").write_text(find_requirement("onnx") + "\n", "utf-8", newline="\n")
    resolution = "lowest-direct" if arguments.which == "lowest" else "highest"
    compile_list = [uv, "pip", "compile", "--quiet", "--upgrade", "--python", python, "--resolution"]
    extras = [word for extra in EXTRAS for word in ("--extra", extra)]
    is_installed = (
        check.run(*compile_list, resolution, *extras, "pyproject.toml", lists / "onnx.in", "-o", ours)
        and check.run(*compile_list, "highest", "--constraint", ours, "--group", "dev", "-o", tools)
        and check.run(uv, "pip", "install", "--quiet", "--python", python, "-r", ours, "-r", tools)
        and check.run(uv, "pip", "install", "--quiet", "--python", python, "--no-deps", "--editable", ".")
    )
    selection = ["-m", check.QUICK, *WARNING_OPTIONS[arguments.which], *arguments.tests]
    return 0 if is_installed and check.run_tests(*selection, programs=python.parent) else 1


def find_requirement(name: str) -> str:
    """The line of pyproject.toml on a package, such as ``onnx>=1.18``."""
    return re.search(rf'"({name}[<>=][^"]*)"', (check.ROOT / "pyproject.toml").read_text("utf-8"))[1]  # type: ignore[index]


if __name__ == "__main__":
    raise SystemExit(main())
