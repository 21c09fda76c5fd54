"""Files appear whole or not at all, and what a killed process leaves goes with the next run, never what a running one needs."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import soundfile

from cospeech.cli.demo import EXAMPLE
from cospeech.errors import InputError
from cospeech.files import ABANDONED, PREFIX, all_or_none, atomic, sweep, workplace
from tests.support.leftovers import abandoned

pytestmark = pytest.mark.slow

COSPEECH = [sys.executable, "-m", "cospeech"]


def sizes(folder: Path, before: set[Path]) -> list[int]:
    """Bytes of each new BVH file below a folder in which another process removes folders meanwhile."""
    try:
        return [path.stat().st_size for path in {*folder.rglob("*.bvh")} - before]
    except FileNotFoundError:
        return []


@pytest.fixture
def begun(long_speech):
    """Starts runs, and returns when they are writing."""
    started: list[subprocess.Popen] = []

    def begin(target: Path) -> subprocess.Popen:
        before = {*target.parent.rglob("*.bvh")}
        started.append(subprocess.Popen([*COSPEECH, "generate", str(long_speech), "-o", str(target), "-q"]))
        until = time.monotonic() + 60
        while not any(size > 10_000 for size in sizes(target.parent, before)):
            assert started[-1].poll() is None
            assert time.monotonic() < until
            time.sleep(0.02)
        return started[-1]

    yield begin
    for process in started:
        process.kill()
        process.wait()


def test_killed_its_leftovers_go_with_the_next_run_and_a_running_one_is_left_alone(tmp_path, begun):
    out = tmp_path / "out"
    out.mkdir()
    killed = begun(out / "a.bvh")
    killed.kill()
    killed.wait()
    left = {path.name for path in out.iterdir()}
    assert len(left) == 1
    running = begun(out / "b.bvh")
    beside = {path.name for path in out.iterdir()}
    assert not left & beside  # the second has swept
    soundfile.write(tmp_path / "short.wav", soundfile.read(EXAMPLE, frames=48_000)[0], 48_000)
    subprocess.run([*COSPEECH, "generate", str(tmp_path / "short.wav"), "-o", str(out / "c.bvh"), "-q"], check=True)
    assert {path.name for path in out.iterdir()} == beside | {"c.bvh"}
    assert running.wait(timeout=120) == 0
    assert {path.name for path in out.iterdir()} == {"b.bvh", "c.bvh"}


def test_only_what_is_abandoned_goes(tmp_path):
    ours, theirs = abandoned(tmp_path), abandoned(tmp_path, machine="another", name="b1b2b3b4")
    (ours / "deep").mkdir()
    (ours / "deep" / "0.bvh").write_text("half")
    notes = tmp_path / f"{PREFIX}notes"
    notes.mkdir()
    (notes / "mine.txt").write_text("a folder of the user's")
    marked = tmp_path / f"{PREFIX}c1c2c3c4"
    marked.mkdir()
    (marked / "lock").write_text("of somebody else's program")
    empty = tmp_path / f"{PREFIX}d1d2d3d4"
    empty.mkdir()  # its process is about to lock it
    link = tmp_path / f"{PREFIX}link"
    link.symlink_to(notes)
    with workplace(tmp_path) as own:
        sweep(tmp_path)
        assert own.is_dir()
        kept = {theirs, notes, marked, empty, link, own}
        assert {*tmp_path.iterdir()} == kept
        long_ago = time.time() - ABANDONED - 60
        for path in (theirs, theirs / "lock", notes, notes / "mine.txt", marked, marked / "lock", empty):
            os.utime(path, (long_ago, long_ago))
        sweep(tmp_path)
        assert {*tmp_path.iterdir()} == {notes, marked, link, own}
        assert (notes / "mine.txt").exists()
    assert not own.exists()


def test_where_nothing_can_be_locked_age_tells(tmp_path, monkeypatch):
    monkeypatch.setattr("cospeech.files.fcntl", None)
    with workplace(tmp_path) as own:
        assert (own / "lock").exists()
        young = abandoned(tmp_path)
        sweep(tmp_path)
        assert {*tmp_path.iterdir()} == {own, young}
        for path in (young / "lock", young):
            os.utime(path, (0, 0))
        sweep(tmp_path)
        assert {*tmp_path.iterdir()} == {own}
    assert not own.exists()


def test_a_program_that_was_started_meanwhile_holds_no_lock(tmp_path):
    """The decoder, say, that outlives its parent for a moment."""
    with workplace(tmp_path) as place:
        code = "import fcntl, sys; fcntl.flock(open(sys.argv[1]), fcntl.LOCK_SH | fcntl.LOCK_NB)"
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"], close_fds=False)
        held = tmp_path / "held"
        held.hardlink_to(place / "lock")
        assert subprocess.run([sys.executable, "-c", code, held], stderr=subprocess.DEVNULL, check=False).returncode != 0
    try:
        subprocess.run([sys.executable, "-c", code, held], check=True)
    finally:
        child.kill()
        child.wait()


def _interrupted(target: Path) -> None:
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
        _interrupted(target)
    assert ([*tmp_path.iterdir()], target.read_text()) == ([target], "whole")


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
    with pytest.raises(InputError) as caught, atomic(folder / "a.bvh"):
        raise AssertionError
    assert str(caught.value) == f"cannot write {str(folder / 'a.bvh')!r}: {os.strerror(number)}{hint}"


def test_an_error_of_writing_names_the_file_and_no_other(tmp_path):
    named = []
    for names_it in (True, False):  # else another file could not be written: this one can
        with pytest.raises(OSError, match="No space") as caught, atomic(tmp_path / "a.bvh") as temporary:
            raise OSError(errno.ENOSPC, "No space left on device", *[str(temporary)] * names_it)
        named.append(caught.value.filename)
    target = tmp_path / "b.bvh"
    with pytest.raises(OSError, match="No space") as caught, all_or_none([target]) as place, atomic(place(target)) as temporary:
        raise OSError(errno.ENOSPC, "No space left on device", str(temporary))
    assert [*named, caught.value.filename] == [str(tmp_path / "a.bvh"), None, str(target)]
