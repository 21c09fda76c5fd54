"""Files appear whole or not at all, and what a killed process leaves goes with the next run, never what a running one needs."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import soundfile

from cospeech.cli.demo import EXAMPLE
from cospeech.errors import InputError
from cospeech.files import ABANDONED, PREFIX, all_or_none, atomic, check_destination, parse_json, sweep, workplace
from tests.support.leftovers import make_leftover

pytestmark = pytest.mark.slow

COSPEECH = [sys.executable, "-m", "cospeech"]


def sizes(folder: Path, before: set[Path]) -> list[int]:
    """Bytes of each new BVH file below a folder in which another process removes folders meanwhile."""
    try:
        return [path.stat().st_size for path in {*folder.rglob("*.bvh")} - before]
    except FileNotFoundError:
        return []


@pytest.fixture
def begin_run(long_speech):
    """A function that starts a run, and returns when the run is writing."""
    processes: list[subprocess.Popen] = []

    def begin(target: Path) -> subprocess.Popen:
        before = {*target.parent.rglob("*.bvh")}
        processes.append(subprocess.Popen([*COSPEECH, "generate", str(long_speech), "-o", str(target), "-q"]))
        until = time.monotonic() + 60
        while not any(size > 10_000 for size in sizes(target.parent, before)):
            assert processes[-1].poll() is None
            assert time.monotonic() < until
            time.sleep(0.02)
        return processes[-1]

    yield begin
    for process in processes:
        process.kill()
        process.wait()


def test_leftovers_of_a_killed_run_go_with_the_next_one_and_a_running_one_is_left_alone(tmp_path, begin_run):
    out = tmp_path / "out"
    out.mkdir()
    first = begin_run(out / "a.bvh")
    first.kill()
    first.wait()
    left = {path.name for path in out.iterdir()}
    assert len(left) == 1
    running = begin_run(out / "b.bvh")
    beside = {path.name for path in out.iterdir()}
    assert not left & beside  # the second has swept
    soundfile.write(tmp_path / "short.wav", soundfile.read(EXAMPLE, frames=48_000)[0], 48_000)
    subprocess.run([*COSPEECH, "generate", str(tmp_path / "short.wav"), "-o", str(out / "c.bvh"), "-q"], check=True)
    assert {path.name for path in out.iterdir()} == beside | {"c.bvh"}
    assert running.wait(timeout=120) == 0
    assert {path.name for path in out.iterdir()} == {"b.bvh", "c.bvh"}


def test_only_what_is_abandoned_goes(tmp_path):
    ours, theirs = make_leftover(tmp_path), make_leftover(tmp_path, machine="another", name="b1b2b3b4")
    (ours / "deep").mkdir()
    (ours / "deep" / "0.bvh").write_text("half")
    notes = tmp_path / f"{PREFIX}notes"
    notes.mkdir()
    (notes / "mine.txt").write_text("a folder of the user's")
    foreign = tmp_path / f"{PREFIX}c1c2c3c4"
    foreign.mkdir()
    (foreign / "lock").write_text("of somebody else's program")
    empty = tmp_path / f"{PREFIX}d1d2d3d4"
    empty.mkdir()  # its process is about to lock it
    link = tmp_path / f"{PREFIX}link"
    link.symlink_to(notes)
    with workplace(tmp_path) as own:
        sweep(tmp_path)
        assert own.is_dir()
        expected = {theirs, notes, foreign, empty, link, own}
        assert {*tmp_path.iterdir()} == expected
        long_ago = time.time() - ABANDONED - 60
        for path in (theirs, theirs / "lock", notes, notes / "mine.txt", foreign, foreign / "lock", empty):
            os.utime(path, (long_ago, long_ago))
        sweep(tmp_path)
        assert {*tmp_path.iterdir()} == {notes, foreign, link, own}
        assert (notes / "mine.txt").exists()
    assert not own.exists()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no such pipes")
@pytest.mark.parametrize("lead", ["pipe", "link"])
def test_a_folder_of_somebody_else_keeps_nobody_waiting(tmp_path, lead):
    """In a folder where all may write, such as that for temporary files, anybody can make one with our prefix."""
    trap = tmp_path / f"{PREFIX}a1a2a3a4"
    trap.mkdir()
    os.mkfifo(tmp_path / "pipe")
    (trap / "lock").symlink_to(tmp_path / "pipe") if lead == "link" else (tmp_path / "pipe").rename(trap / "lock")
    code = "import sys; from pathlib import Path; from cospeech.files import sweep; sweep(Path(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=True, timeout=20)
    assert trap.is_dir()


@pytest.fixture
def without_locks(monkeypatch) -> set[Path]:
    """As on Windows: no locks, and a file that is open cannot be removed. The set: what others have open."""
    monkeypatch.setattr("cospeech.files.workplaces.fcntl", None)
    open_files, unlink = set[Path](), os.unlink

    def refuse(path: str | Path, **keywords: Any) -> None:
        folder = Path(f"/proc/self/fd/{keywords['dir_fd']}").resolve() if keywords.get("dir_fd") is not None else Path()
        whole = (folder / os.fspath(path)).absolute()
        if whole in open_files or whole in {each.resolve() for each in Path("/proc/self/fd").iterdir()}:
            raise PermissionError(errno.EACCES, "The process cannot access the file", str(path))
        unlink(path, **keywords)

    monkeypatch.setattr(os, "unlink", refuse)
    return open_files


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="tells what this process has open")
def test_where_nothing_can_be_locked_an_open_file_tells(tmp_path, without_locks):
    with workplace(tmp_path) as own:
        assert {path.name for path in own.iterdir()} == {"lock"}
        old, running = make_leftover(tmp_path), make_leftover(tmp_path, name="a1b2c3d4")
        theirs = make_leftover(tmp_path, machine="another", name="b1b2b3b4")
        (old / "0.bvh").write_text("half")
        without_locks.add(running / "lock")
        sweep(tmp_path)
        assert {*tmp_path.iterdir()} == {own, running, theirs}  # of another machine: nobody knows yet
        for path in (running, running / "lock", theirs, theirs / "lock", own, own / "lock"):
            os.utime(path, (0, 0))
        sweep(tmp_path)
        assert {*tmp_path.iterdir()} == {own, running}
    assert not own.exists()


def test_where_rights_move_with_files_folders_have_the_usual_ones(tmp_path, monkeypatch):
    """Windows: Python gives a folder of mode 0o700 a list of rights that files keep when they are moved out."""
    (tmp_path / "usual").mkdir()
    with workplace(tmp_path) as private:
        assert private.stat().st_mode & 0o777 == 0o700
    monkeypatch.setattr("cospeech.files.workplaces.fcntl", None)
    with workplace(tmp_path) as own:
        assert own.stat().st_mode == (tmp_path / "usual").stat().st_mode


def _write_both(first: Path, second: Path, meanwhile: Callable[[], object]) -> None:
    with all_or_none([first, second]) as place:
        for path in (first, second):
            place(path).write_text("new")
        meanwhile()


def test_a_file_that_another_program_has_open_is_told_before_the_work_and_keeps_back_all(tmp_path, monkeypatch):
    """Windows refuses to replace it; `generate` asks before it begins (`check_destination`)."""
    monkeypatch.setattr("cospeech.files._REPLACES_OPEN", False)
    new, old = tmp_path / "new.bvh", tmp_path / "kept.csv"
    old.write_text("kept")
    open_files = {old}
    for name in ("rename", "replace"):
        usual = getattr(Path, name)

        def refuse(path: Path, target: Path, usual: Any = usual) -> Path:
            if {path, Path(target)} & open_files:
                raise PermissionError(errno.EACCES, "Permission denied", str(path))
            return usual(path, target)

        monkeypatch.setattr(Path, name, refuse)
    message = r"cannot write '.*kept.csv': Permission denied \(does another program have it open\?"
    with pytest.raises(InputError, match=message):
        check_destination(old)
    for write in (atomic(old), all_or_none([new, old])):
        with pytest.raises(InputError, match=message), write:
            raise AssertionError
    open_files.clear()
    with pytest.raises(InputError, match=message):
        _write_both(new, old, lambda: open_files.add(old))  # while the work goes on
    assert ({*tmp_path.iterdir()}, old.read_text()) == ({old}, "kept")
    open_files.clear()
    _write_both(new, old, list)
    assert (new.read_text(), old.read_text()) == ("new", "new")


def test_a_program_that_was_started_meanwhile_holds_no_lock(tmp_path):
    """For example the decoder, which outlives its parent for a moment."""
    with workplace(tmp_path) as place:
        code = "import fcntl, sys; fcntl.flock(open(sys.argv[1]), fcntl.LOCK_SH | fcntl.LOCK_NB)"
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"], close_fds=False)
        link = tmp_path / "held"
        link.hardlink_to(place / "lock")
        assert subprocess.run([sys.executable, "-c", code, link], stderr=subprocess.DEVNULL, check=False).returncode != 0
    try:
        subprocess.run([sys.executable, "-c", code, link], check=True)
    finally:
        child.kill()
        child.wait()


def _interrupt(target: Path) -> None:
    with atomic(target) as path:
        path.write_text("half")
        raise KeyboardInterrupt


def test_atomic_leaves_no_trace(tmp_path):
    target = tmp_path / "a.txt"
    with atomic(target) as path:
        path.write_text("whole")
        assert not target.exists()
    assert [*tmp_path.iterdir()] == [target]
    with pytest.raises(KeyboardInterrupt):
        _interrupt(target)
    assert ([*tmp_path.iterdir()], target.read_text()) == ([target], "whole")


@pytest.mark.parametrize("mask", [0o077, 0o002])
def test_a_file_has_the_rights_of_any_new_file_and_the_process_keeps_its_mask(tmp_path, monkeypatch, mask):
    """The mask is of the process: while it is changed, files of other threads would be open to all."""
    before = os.umask(mask)
    try:
        with monkeypatch.context() as patch:
            patch.setattr(os, "umask", None)
            with atomic(tmp_path / "a.txt") as path:
                path.unlink()
                path.touch(0o600)
    finally:
        os.umask(before)
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o666 & ~mask


def test_a_read_only_file_is_not_replaced(tmp_path):
    target = tmp_path / "kept.bvh"
    target.write_text("kept")
    target.chmod(0o444)
    (tmp_path / "link.bvh").symlink_to(target)
    for path in (target, tmp_path / "link.bvh"):
        for write in (atomic(path), all_or_none([tmp_path / "new.bvh", path])):
            with pytest.raises(InputError, match=r"cannot write '.*': the file is read-only \(name another file"), write:
                raise AssertionError
    assert (target.read_text(), target.stat().st_mode & 0o777) == ("kept", 0o444)
    assert {path.name for path in tmp_path.iterdir()} == {"kept.bvh", "link.bvh"}


@pytest.mark.parametrize(
    ("number", "there", "hint"),
    [
        (errno.EACCES, True, " (may you write into this folder?)"),
        (errno.EROFS, True, " (may you write into this folder?)"),
        (errno.ENOSPC, True, ""),
        (errno.ENOENT, False, " (does the folder exist?)"),
    ],
)
def test_the_hint_fits_the_folder(tmp_path, monkeypatch, number, there, hint):
    """Root may write everywhere, so the system's answer is played."""

    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    folder = tmp_path if there else tmp_path / "nowhere"
    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(InputError) as refusal, atomic(folder / "a.bvh"):
        raise AssertionError
    assert str(refusal.value) == f"cannot write {str(folder / 'a.bvh')!r}: {os.strerror(number)}{hint}"


def test_an_error_of_writing_names_the_file_and_no_other(tmp_path):
    filenames = []
    for names_it in (True, False):  # else another file could not be written: this one can
        with pytest.raises(OSError, match="No space") as error, atomic(tmp_path / "a.bvh") as temporary:
            raise OSError(errno.ENOSPC, "No space left on device", *[str(temporary)] * names_it)
        filenames.append(error.value.filename)
    target = tmp_path / "b.bvh"
    with pytest.raises(OSError, match="No space") as error, all_or_none([target]) as place, atomic(place(target)) as temporary:
        raise OSError(errno.ENOSPC, "No space left on device", str(temporary))
    assert [*filenames, error.value.filename] == [str(tmp_path / "a.bvh"), None, str(target)]


@pytest.mark.parametrize("number", ["1e999", "-1E+999", "1" + "0" * 320 + ".5"])
@pytest.mark.parametrize("encode", [str, str.encode], ids=["text", "bytes"])
def test_json_beyond_all_floats_is_refused(number, encode):
    with pytest.raises(InputError, match=r"^a\.json holds -?1[e0E+9]{3,20}( in 'fps')? \(only finite"):
        parse_json(encode(f'{{"fps": {number}}}'), "a.json", 10)
    assert parse_json(encode('{"fps": 1e-999, "steps": [2E5, 1e300]}'), "a.json", 10) == {"fps": 0.0, "steps": [2e5, 1e300]}
