"""House rules that a program can check (docs/contributing.md, "House rules")."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "src" / "cospeech"
FILES = sorted(PACKAGE.rglob("*.py"))
PICKLERS = {"pickle", "marshal", "shelve", "dill"}
MACHINES = r"/(?:home|root|work|Users)/\S+|(?:localhost|127\.0\.0\.1):\d+/simple"
LINES = {"export": 200, "export/render": 400, "metrics": 200}  # of a file, by folder; any other file may have 400
FUNCTION_LINES = 60
FORBIDDEN_CALLS = {"eval", "exec", "print", "input", "breakpoint", "sys.exit", "exit", "quit", "pickle.load", "pickle.loads"}
FORBIDDEN_CALLS |= {
    "sys.path.append",
    "sys.path.insert",
    "sys.path.extend",
    "np.random.seed",
    "random.seed",
    "torch.manual_seed",
    "os.system",
    "yaml.load",
}
ABSOLUTE = re.compile(r"^(/(home|root|work|tmp|usr|mnt|data|Users|opt)/|[A-Z]:\\)")


def name_of(node: ast.AST) -> str:
    """`np.random.seed` of the expression that says so; "" of anything else."""
    if isinstance(node, ast.Attribute):
        return f"{name_of(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def faults_of_call(node: ast.Call, in_cli: bool) -> list[str]:
    name, keywords = name_of(node.func), {k.arg: k.value for k in node.keywords}
    problems = []
    if name in FORBIDDEN_CALLS and not (in_cli and name in {"print", "sys.exit"}):
        problems.append(f"calls {name}()")
    if name.endswith(".cuda"):
        problems.append("calls .cuda()")
    if name == "torch.load" and not is_true(keywords.get("weights_only")):
        problems.append("torch.load without weights_only=True")
    if is_true(keywords.get("allow_pickle")) or is_true(keywords.get("shell")):
        problems.append("allow_pickle=True or shell=True")
    return problems


def lines_of(function: ast.FunctionDef) -> int:
    """Lines of a function without its docstring, so that nobody saves words there."""
    first = function.body[0]
    has_docstring = ast.get_docstring(function, clean=False) is not None
    words = (first.end_lineno or 0) - first.lineno + 1 if has_docstring else 0
    return (function.end_lineno or 0) - function.lineno + 1 - words


def is_true(node: ast.AST | None) -> bool:
    return isinstance(node, ast.Constant) and node.value is True


def faults(source: str, *, in_cli: bool = False) -> list[str]:
    """What a file does that house rules forbid, one line each."""
    tree, problems = ast.parse(source), []
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            problems += faults_of_call(node, in_cli)
        elif isinstance(node, ast.ImportFrom) and any(alias.name == "*" for alias in node.names):
            problems.append("star import")
        elif isinstance(node, ast.Import) and any(alias.name in PICKLERS for alias in node.names):
            problems.append("imports a pickler")
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and ABSOLUTE.match(node.value):
            problems.append(f"absolute path {node.value!r}")
        elif isinstance(node, ast.FunctionDef) and (size := lines_of(node)) > FUNCTION_LINES:
            problems.append(f"{node.name}() has {size} lines")
    if not ast.get_docstring(tree):
        problems.append("no docstring at the top")
    return problems


def relative(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def test_no_file_breaks_the_house_rules():
    wrong = {
        relative(p): problems for p in FILES if (problems := faults(p.read_text("utf-8"), in_cli=relative(p) == "cli/main.py"))
    }
    assert wrong == {}


def test_files_are_small():
    sizes = {relative(path): len(path.read_text("utf-8").splitlines()) for path in FILES}
    assert {name: size for name, size in sizes.items() if size > LINES.get(name.rpartition("/")[0], 400)} == {}


def test_there_are_no_grab_bags():
    assert [relative(p) for p in FILES if re.search(r"^(utils?|helpers?|misc|common)$|_v\d+$", p.stem)] == []


@pytest.mark.parametrize("path", FILES, ids=relative)
def test_all_names_what_is_public(path):
    """`__all__` is there, holds no ghosts, and what is defined in the file and not underscored is in it or unused outside."""
    if path.name == "__main__.py":
        pytest.skip("run, never imported")
    tree = ast.parse(path.read_text("utf-8"))
    if all(isinstance(node, ast.Expr) for node in tree.body):
        return  # a docstring alone
    parts = ["cospeech", *path.relative_to(PACKAGE).with_suffix("").parts]
    module = import_module(".".join(part for part in parts if part != "__init__"))
    assert hasattr(module, "__all__"), f"{relative(path)} has no __all__"
    assert len(set(module.__all__)) == len(module.__all__)
    assert [name for name in module.__all__ if not hasattr(module, name)] == []


@pytest.mark.parametrize("name", ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "pyproject.toml", "Makefile", "uv.lock"])
def test_files_of_the_house_name_no_machine(name):
    assert (
        re.findall(r"/(?:home|root|work|Users)/\S+|(?:localhost|127\.0\.0\.1):\d+/simple", (ROOT / name).read_text("utf-8"))
        == []
    )


def test_the_lock_names_no_private_index():
    hosts = set(re.findall(r"https?://([^/\"]+)", (ROOT / "uv.lock").read_text("utf-8")))
    assert hosts == {"pypi.org", "files.pythonhosted.org"}


@pytest.mark.parametrize(
    ("source", "fault"),
    [
        ("print(1)", "calls print()"),
        ("eval('1')", "calls eval()"),
        ("import numpy as np\nnp.random.seed(0)", "calls np.random.seed()"),
        ("model.cuda()", "calls .cuda()"),
        ("torch.load('x')", "torch.load without weights_only=True"),
        ("np.load('x', allow_pickle=True)", "allow_pickle=True or shell=True"),
        ("from numpy import *", "star import"),
        ("import sys\nsys.path.append('x')", "calls sys.path.append()"),
        ("x = '/home/me/x.wav'", "absolute path '/home/me/x.wav'"),
        ("def f():\n" + "    pass\n" * 60, "f() has 61 lines"),
    ],
)
def test_the_test_would_notice(source, fault):
    assert faults(f'"""Doc."""\n{source}') == [fault]


def test_a_public_class_name_exists_once():
    """But for `Writer`, which the registry of formats asks of every module of a format."""
    homes: dict[str, list[str]] = {}
    for path in FILES:
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(relative(path))
    assert {name: places for name, places in homes.items() if len(places) > 1 and name != "Writer"} == {}
