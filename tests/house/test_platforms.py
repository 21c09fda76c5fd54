"""What Windows and macOS do otherwise is imitated here: the tests run on neither of them."""

from __future__ import annotations

import ast
import errno
import io
import json
import os
import shutil
import socket
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import typer.core

from cospeech.cli.demo import EXAMPLE
from cospeech.cli.standard_streams import ready_streams
from cospeech.errors import InputError
from cospeech.export.checks import check_apart
from cospeech.export.live.outlets import LineWire, UdpWire
from cospeech.studio.server import open_socket
from tests.support.command_line import type_command

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = [*(ROOT / "src").rglob("*.py"), *(ROOT / "blender").rglob("*.py"), *(ROOT / "tools").rglob("*.py")]
WINDOWS = SimpleNamespace(**{**vars(os), "name": "nt"})

IMPORT_ALL = """
import os, pkgutil, signal, sys
from importlib import import_module

lacks = {"fcntl", "grp", "pwd", "resource", "syslog", "termios", "tty"}

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name in lacks:
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Refuse())
names = ["SIGALRM", "SIGHUP", "SIGKILL", "SIGUSR1", "pthread_sigmask", "setitimer"]
names += ["chown", "fchmod", "fork", "geteuid", "getuid", "killpg", "mkfifo", "nice", "sched_getaffinity", "setsid", "sysconf"]
for name in names:
    vars(signal if hasattr(signal, name) else os).pop(name, None)
import cospeech
found = 0
for module in pkgutil.walk_packages(cospeech.__path__, "cospeech."):
    if not module.name.endswith("__main__"):
        import_module(module.name)
        found += 1
print(found)
"""


@pytest.mark.slow
def test_every_module_can_be_imported_without_what_windows_lacks():
    pytest.importorskip("torch")
    process = subprocess.run([sys.executable, "-c", IMPORT_ALL], capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stderr[-2000:]
    assert int(process.stdout) > 500


def faults(source: str) -> list[str]:
    """Calls that read or write text in a way that depends on the machine: its code page, or its ends of lines."""
    problems = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else ""
        keywords = {keyword.arg for keyword in node.keywords}
        texts = [each.value for each in node.args if isinstance(each, ast.Constant) and isinstance(each.value, str)]
        mode = next((text for text in texts if set(text) <= {*"rwaxbt+"}), "r")
        if name in ("read_text", "write_text") and "encoding" not in keywords and "utf-8" not in texts:
            problems.append(f"{name} without an encoding")
        if (
            name == "open"
            and ("w" in mode or "a" in mode)
            and "b" not in mode
            and "encoding" in keywords
            and "newline" not in keywords
        ):
            problems.append("open without newline")
        if name == "write_text" and "newline" not in keywords:
            problems.append("write_text without newline")
    return problems


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_text_is_the_same_on_every_system(path):
    problems = faults(path.read_text("utf-8"))
    if "src" not in path.parts:  # our own tools: git looks after the ends of their lines (.gitattributes)
        problems = [fault for fault in problems if "newline" not in fault]
    assert problems == []


@pytest.mark.parametrize(
    ("source", "fault"),
    [
        ("path.write_text(text, newline='')", "write_text without an encoding"),
        ("path.read_text()", "read_text without an encoding"),
        ("path.write_text(text, 'utf-8')", "write_text without newline"),
        ("path.open('w', encoding='utf-8')", "open without newline"),
    ],
)
def test_the_test_would_notice(source, fault):
    assert faults(source) == [fault]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="their file systems take no such name")
def test_a_name_that_is_no_utf8_is_written_into_a_report_all_the_same(tmp_path):
    """As unpacked from an archive of another system, or where the terminal speaks ASCII."""
    for name, text in ((b"Zo\xeb.ogg", "Zo�.ogg"), ("Zoë.ogg".encode(), "Zoë.ogg")):
        shutil.copyfile(EXAMPLE, tmp_path / os.fsdecode(name))
        command = [
            sys.executable,
            "-m",
            "cospeech",
            "generate",
            name,
            "-o",
            "a.csv",
            "--parts",
            "face",
            "--report",
            "r.json",
            "-q",
        ]
        variables = os.environ | {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
        subprocess.run(command, cwd=tmp_path, env=variables, check=True)
        assert json.loads((tmp_path / "r.json").read_text("utf-8"))["speech"] == text


class Terminal(io.TextIOWrapper):
    def isatty(self) -> bool:
        return True


def test_a_pipe_gets_utf8_whatever_the_code_page_is(monkeypatch):
    """So that `cospeech list models --json > models.json` is JSON. What is shown stays as the terminal wants it."""
    monkeypatch.delenv("PYTHONIOENCODING", raising=False)
    monkeypatch.setattr("cospeech.cli.standard_streams.os", WINDOWS)
    pipe, terminal = io.TextIOWrapper(io.BytesIO(), "cp1252"), Terminal(io.BytesIO(), "cp1252")
    monkeypatch.setattr(sys, "stdout", pipe)
    monkeypatch.setattr(sys, "stderr", terminal)
    ready_streams()
    for stream in (pipe, terminal):
        print("⌈3 × 30⌉ → Zoë", end="", file=stream, flush=True)
    assert pipe.buffer.getvalue().decode("utf-8") == "⌈3 × 30⌉ → Zoë"  # type: ignore[attr-defined]
    assert terminal.buffer.getvalue().decode("cp1252") == "?3 × 30? ? Zoë"  # type: ignore[attr-defined]


class ClosedPipe(io.RawIOBase):
    """A pipe whose reader has left, as Windows tells it."""

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        raise OSError(errno.EINVAL, "Invalid argument")


def test_a_reader_that_leaves_is_no_error_on_windows_either(monkeypatch):
    monkeypatch.setattr("cospeech.errors.os", WINDOWS)
    with pytest.raises(BrokenPipeError):
        LineWire(ClosedPipe()).send(b"{}")  # type: ignore[arg-type]
    plain = io.TextIOWrapper(io.BufferedWriter(ClosedPipe()), "utf-8")
    for name in ("stdout", "__stdout__"):
        monkeypatch.setattr(sys, name, plain)
    ready_streams()
    sys.stdout.write("hello")
    with pytest.raises(BrokenPipeError):
        sys.stdout.flush()
    with pytest.raises(OSError, match="Invalid argument"):  # what waits in the buffer is tried once more
        plain.buffer.close()
    monkeypatch.setattr("cospeech.errors.os", os)
    with pytest.raises(OSError, match="Invalid argument") as error:
        LineWire(ClosedPipe()).send(b"{}")  # type: ignore[arg-type]
    assert not isinstance(error.value, BrokenPipeError)


def test_two_servers_share_no_port(monkeypatch):
    """Windows' SO_REUSEADDR would let them: it takes the port of a server that runs."""
    monkeypatch.setattr(socket, "SO_EXCLUSIVEADDRUSE", socket.SO_KEEPALIVE, raising=False)
    with open_socket("127.0.0.1", 0) as server:
        assert server.getsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR) == 0
        assert server.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1


@pytest.mark.slow
def test_a_pattern_keeps_its_folders_where_the_shell_looks_up_none(tmp_path, monkeypatch):
    """On Windows, Typer looks patterns up before us; speeches of one name in several folders would clash."""
    for name in ("ann", "ben"):
        (tmp_path / "rec" / name).mkdir(parents=True)
        shutil.copyfile(EXAMPLE, tmp_path / "rec" / name / "talk.ogg")
    monkeypatch.setattr(typer.core, "os", WINDOWS)
    type_command("generate rec/*/talk.ogg -o out/{name}.csv --parts face -q", tmp_path)
    assert {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.csv")} == {
        "out/ann/talk.csv",
        "out/ben/talk.csv",
    }


def test_datagrams_to_localhost_go_to_where_receivers_listen(monkeypatch):
    """Windows and macOS name IPv6's address of localhost first; VMC's receivers listen on IPv4's."""
    usual = socket.getaddrinfo
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5)
        port = receiver.getsockname()[1]
        six = (socket.AF_INET6, socket.SOCK_DGRAM, 17, "", ("::1", port, 0, 0))
        monkeypatch.setattr(socket, "getaddrinfo", lambda *a, **n: [six, *usual("127.0.0.1", port, type=socket.SOCK_DGRAM)])
        wire = UdpWire("localhost", port)
        wire.connect()
        wire.send(b"frame")
        assert receiver.recv(100) == b"frame"
        wire.close()


def test_a_datagram_that_windows_calls_reset_was_refused_and_no_more():
    def reset(data: bytes) -> int:
        raise ConnectionResetError(errno.ECONNRESET, "forcibly closed")

    wire = UdpWire("127.0.0.1", 9)
    wire._socket = SimpleNamespace(send=reset, close=lambda: None)  # type: ignore[assignment]
    assert not wire.is_refused
    wire.send(b"frame")
    assert wire.is_refused


def test_files_that_differ_in_capital_letters_are_one_file_where_the_system_says_so(tmp_path):
    """A link under the other name plays a system that does not tell capital letters."""
    one, other = tmp_path / "talks" / "Talk.bvh", tmp_path / "talks" / "talk.bvh"
    one.parent.mkdir()
    check_apart([one, other], [])
    (tmp_path / "TALKS").symlink_to(one.parent)
    with pytest.raises(InputError, match=r"talk.bvh' would overwrite another output"):
        check_apart([one, other], [])
    with pytest.raises(InputError, match="would overwrite what is read"):
        check_apart([tmp_path / "talks" / "Ze\u0301.bvh"], [tmp_path / "talks" / "zé.bvh"])
