"""The command line as a process: signals, terminals, closed pipes."""

from __future__ import annotations

import os
import pty
import resource
import signal
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import pytest

from cospeech.cli.demo import EXAMPLE
from cospeech.export.html_page import VIEWER
from tests.support.command_line import heed

pytestmark = pytest.mark.slow

COSPEECH = [sys.executable, "-m", "cospeech"]


def test_help_imports_nothing_heavy():
    """So ``cospeech --help`` takes less than half a second; the time itself is in the table of benchmarks."""
    code = (
        "import sys; sys.argv = ['cospeech', '--help']\nfrom cospeech.cli import main\ntry: main()\nexcept SystemExit: pass\n"
    )
    code += "heavy = {'numpy', 'scipy', 'rich', 'pydantic', 'soundfile', 'PIL', 'av', 'onnxruntime'}\n"
    code += "print(sorted({m.split('.')[0] for m in sys.modules} & heavy))"
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert process.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_stopped_in_the_middle_nothing_is_left(tmp_path, long_speech, number, code):
    out = tmp_path / "out"
    out.mkdir()
    slow = out / "b.mp4"  # takes a minute: a signal that is late on a busy machine still comes in the middle
    command = [*COSPEECH, "generate", str(long_speech), "-o", str(out / "a.bvh"), "-o", str(slow)]
    heeds = heed(signal.SIGINT)
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=heeds)
    until = time.monotonic() + 60
    while not any(path.stat().st_size > 10_000 for path in out.rglob("*.bvh")):  # it is writing now
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < until
        time.sleep(0.02)
    os.killpg(process.pid, number)  # as a terminal does: the decoder gets it too
    _, err = process.communicate(timeout=90)
    assert process.returncode == code
    assert "Traceback" not in err
    assert list(out.iterdir()) == []


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="only Linux tells the children of a process")
def test_several_jobs_may_be_stopped_while_their_processes_begin(tmp_path, long_speech):
    (tmp_path / "in").mkdir()
    for name in ("a", "b"):
        (tmp_path / "in" / f"{name}.wav").symlink_to(long_speech)
    command = [*COSPEECH, "generate", "in", "-o", "out/", "--jobs", "2"]
    pipes = {"stderr": subprocess.PIPE, "text": True, "cwd": tmp_path, "preexec_fn": heed(signal.SIGINT)}
    for wait in (0.0, 0.1, 0.3):
        process = subprocess.Popen(command, start_new_session=True, **pipes)
        children, until = Path(f"/proc/{process.pid}/task/{process.pid}/children"), time.monotonic() + 60
        while len(children.read_text(encoding="utf-8").split()) < 3:  # one of them keeps watch over what the others share
            assert time.monotonic() < until
            time.sleep(0.005)
        time.sleep(wait)
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=90)
        assert (process.returncode, "Traceback" in err) == (130, False), err
        assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_several_jobs_that_are_stopped_leave_nothing(tmp_path, long_speech, number, code):
    """The program tells its processes to stop, and does not rely on signals; they end at the next piece of motion."""
    (tmp_path / "in").mkdir()
    for name in ("a", "b", "c"):
        (tmp_path / "in" / f"{name}.wav").symlink_to(long_speech)
    command = [*COSPEECH, "generate", "in", "-o", "out/", "--jobs", "2"]
    pipes = {"stderr": subprocess.PIPE, "text": True, "cwd": tmp_path, "preexec_fn": heed(signal.SIGINT)}
    for stop in (os.kill, os.killpg):  # as a supervisor does, and as a terminal
        process = subprocess.Popen(command, start_new_session=True, **pipes)
        until = time.monotonic() + 60
        while not any(path.stat().st_size > 10_000 for path in tmp_path.glob("out/.*/**/*.bvh")):  # it is writing now
            assert process.poll() is None, process.stderr.read()
            assert time.monotonic() < until
            time.sleep(0.02)
        stop(process.pid, number)
        _, err = process.communicate(timeout=90)
        assert process.returncode == code
        assert "Traceback" not in err
        assert not [*tmp_path.glob("out/*")]


def read_terminal(handle: int) -> bytes:
    """What was written; nothing once the other end is closed, which Linux calls an input error."""
    try:
        return os.read(handle, 4096)
    except OSError:
        return b""


def test_a_terminal_sees_progress_and_a_file_does_not(tmp_path, long_speech):
    """On a terminal a bar appears after a second; not in a pipe, and never on stdout."""
    command = [*COSPEECH, "generate", str(long_speech), "-o", str(tmp_path / "a.bvh")]
    ours, theirs = pty.openpty()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs, env=os.environ | {"TERM": "xterm"}) as process:
        os.close(theirs)
        screen = b"".join(iter(lambda: read_terminal(ours), b""))
        out = process.stdout.read()
    os.close(ours)
    assert process.returncode == 0
    assert b"generating" in screen
    assert b"generating" not in out
    assert b"a.bvh" in out


@pytest.mark.parametrize("buffering", ["", "1"])
@pytest.mark.parametrize("command", ["list styles", "list styles --json", "--help", "list --help", "--version"])
def test_closed_pipe_is_no_crash(command, buffering):
    environment = os.environ | {"PYTHONUNBUFFERED": buffering}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen([*COSPEECH, *command.split()], env=environment, **pipes)
    process.stdout.close()
    assert process.stderr.read() == b""
    assert process.wait() == 0
    process.stderr.close()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize("buffering", ["", "1"])
def test_output_that_cannot_be_written_is_one_line(buffering):
    environment = os.environ | {"PYTHONUNBUFFERED": buffering}
    with open("/dev/full", "wb") as full:  # noqa: PTH123  a device
        process = subprocess.run([*COSPEECH, "list", "styles"], stdout=full, stderr=subprocess.PIPE, env=environment)
    assert process.returncode == 1
    message = b"error: cannot write standard output: No space left on device (files that were made before are complete)\n"
    assert process.stderr == message


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_of_which_a_library_makes_an_error_ends_the_program(cli, monkeypatch, number, code):
    def fail(what):
        try:
            signal.raise_signal(number)
        except BaseException as error:
            raise ImportError("initialization failed") from error  # as pybind11 does

    monkeypatch.setattr("cospeech.cli.catalogue.catalogue_text", fail)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # the tests may run where Ctrl-C is ignored: behind an &
    assert cli("list", "models") == (code, "", "interrupted\n" if code == 130 else "")


def test_an_error_of_the_system_names_the_file(cli, monkeypatch):
    def fail(what):
        raise OSError(27, "File too large", "stores/pose.npy")

    monkeypatch.setattr("cospeech.cli.catalogue.catalogue_text", fail)
    code, _, err = cli("list", "models")
    assert (code, err) == (1, "error: 'stores/pose.npy': File too large (is there room on the disk, and in memory?)\n")


def test_whoever_stops_prepare_is_told_how_to_go_on(cli, monkeypatch):
    def stop(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("cospeech.corpora.prepare.prepare", stop)
    assert cli("prepare", "folder", "x", "y") == (130, "", "run the same command again to go on\ninterrupted\n")


def test_runs_where_the_terminal_speaks_ascii(tmp_path):
    environment = os.environ | {"PYTHONIOENCODING": "ascii", "LC_ALL": "C"}
    process = subprocess.run([*COSPEECH, "generate", "--help"], capture_output=True, env=environment)
    assert (process.returncode, process.stderr) == (0, b"")
    process = subprocess.run([*COSPEECH, "generate", "käse.wav"], capture_output=True, env=environment, cwd=tmp_path)
    assert process.returncode == 2
    assert process.stderr.startswith(b"error: ")


def test_full_disk(tmp_path):
    """As on a full disk: files cannot grow beyond 50 kB."""

    def little_room() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))

    film = [".mp4"] if find_spec("av") else []
    page = [".html"] if (VIEWER / "viewer.js").is_file() else []
    for suffix in (".bvh", ".glb", ".csv", ".npz", ".png", *film, *page):
        command = [*COSPEECH, "generate", str(EXAMPLE), "-o", f"a{suffix}"]
        process = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, preexec_fn=little_room)
        assert (process.returncode, process.stdout) == (1, ""), suffix
        assert process.stderr.startswith(f"error: 'a{suffix}': File too large"), suffix
        assert process.stderr.count("\n") == 1
        assert list(tmp_path.iterdir()) == []


def test_unwritable_folder(tmp_path):
    if os.geteuid() == 0:
        pytest.skip("root may write everywhere")
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    process = subprocess.run([*COSPEECH, "generate", str(EXAMPLE), "-o", str(Path(folder, "a.bvh"))], capture_output=True)
    assert (process.returncode, list(folder.iterdir())) == (2, [])
