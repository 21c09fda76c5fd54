"""What users do by mistake, and what machines do to programs: the cases that once went wrong."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import soundfile

import cospeech
from cospeech import InputError, Motion
from cospeech.cli.demo import EXAMPLE
from cospeech.export import FORMATS
from cospeech.files import all_or_none, atomic
from tests.support.command_line import heed
from tests.support.motions import gesturing

pytestmark = pytest.mark.slow

COMMAND = [sys.executable, "-m", "cospeech"]
posix = pytest.mark.skipif(os.name != "posix", reason="links, pipes and signals as POSIX has them")


@pytest.fixture
def place(tmp_path, monkeypatch):
    """An empty working folder with a second of speech in it."""
    monkeypatch.chdir(tmp_path)
    speech, rate = soundfile.read(EXAMPLE, frames=48_000, dtype="float32")
    soundfile.write("talk.wav", speech[:rate], rate)
    return tmp_path


def run(*arguments: str, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=60, check=False, **options)


def names() -> list[str]:
    return sorted(path.name for path in Path().iterdir())


def refuse(process: subprocess.CompletedProcess[str]) -> str:
    """Assert exit code 2 and one line of error; gives this line."""
    assert process.returncode == 2
    assert process.stdout == ""
    assert process.stderr.startswith("error: ")
    assert process.stderr.count("\n") == 1
    return process.stderr


# --- where files go --------------------------------------------------------------------------------------------------------


def write_atomic(*targets: Path) -> None:
    for target in targets:
        with atomic(target) as temporary:
            temporary.write_text(target.name)


def write_together(*targets: Path) -> None:
    with all_or_none(targets) as place:
        for target in targets:
            place(target).write_text(target.name)


@posix
@pytest.mark.parametrize("write", [write_atomic, write_together])
def test_links_are_written_through(tmp_path, write):
    """Two links of one name, in two folders, to two files in a third."""
    links = []
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        links.append(tmp_path / side / "talk.bvh")
        links[-1].symlink_to(tmp_path / f"{side}.dat")
    (tmp_path / "left.dat").write_text("old")
    write(*links)
    assert all(link.is_symlink() for link in links)
    assert {path.name: path.read_text() for path in tmp_path.glob("*.dat")} == dict.fromkeys(
        ("left.dat", "right.dat"), "talk.bvh"
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["left", "left.dat", "right", "right.dat"]


@posix
@pytest.mark.parametrize("write", [write_atomic, write_together])
@pytest.mark.parametrize("kind", ["pipe", "device", "loop", "folder", "null character", "long name", "below a file"])
def test_what_no_file_can_replace_is_left_alone(tmp_path, write, kind):
    target = tmp_path / "talk.bvh"
    if kind == "pipe":
        os.mkfifo(target)
    elif kind == "device":
        target.symlink_to("/dev/null")
    elif kind == "loop":
        target.symlink_to(target)
    elif kind == "folder":
        target.mkdir()
    elif kind == "null character":
        target = tmp_path / "a\0.bvh"
    elif kind == "long name":
        target = tmp_path / ("n" * 252 + ".bvh")
    else:
        target.write_text("a file")
        target /= "talk.bvh"
    before = sorted(tmp_path.iterdir())
    with pytest.raises(InputError, match="cannot write"):
        write(tmp_path / "other.bvh", target)
    left = sorted(tmp_path.iterdir())
    assert [path for path in left if path.name != "other.bvh"] == before
    assert not Path("/dev/null").is_file()


@pytest.mark.parametrize("role", ["--transcript", "--report"])
def test_takes_do_not_overwrite_what_is_read_or_written(place, role):
    """With two takes talk.json becomes talk.1.json."""
    words = '[{"word": "hello", "start": 0.1, "end": 0.5}]'
    Path("talk.1.json").write_text(words, encoding="utf-8")
    assert "'talk.1.json' would overwrite" in refuse(
        run("generate", "talk.wav", "-o", "talk.json", "--takes", "2", role, "talk.1.json")
    )
    assert Path("talk.1.json").read_text(encoding="utf-8") == words
    assert names() == ["talk.1.json", "talk.wav"]


def test_numbers_are_said_in_full(place):
    err = refuse(run("generate", "talk.wav", "-o", "a.bvh", "--seed", str(2**63)))
    assert f"seed {2**63} is out of range (0 … {2**63 - 1})" in err


# --- what surrounds the program --------------------------------------------------------------------------------------------


@posix
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams(place, closed):
    line = " ".join(COMMAND)
    process = subprocess.run(
        f"{line} generate talk.wav -o a.bvh {closed}", shell=True, capture_output=True, timeout=60, check=False
    )
    assert process.returncode == 0
    assert len(Motion.load("a.bvh")) == 30
    failure = subprocess.run(
        f"{line} generate none.wav -o b.bvh {closed}", shell=True, capture_output=True, timeout=60, check=False
    )
    assert failure.returncode == 2


@posix
def test_a_closed_terminal_leaves_nothing(place):
    speech, rate = soundfile.read("talk.wav", dtype="float32")
    soundfile.write("long.flac", np.tile(speech, 400), rate)
    before = names()
    line = [*COMMAND, "generate", "long.flac", "-o", "a.bvh", "-o", "a.glb"]
    working = subprocess.Popen(line, stderr=subprocess.PIPE, preexec_fn=heed(signal.SIGHUP))
    deadline = time.monotonic() + 30
    while names() == before and time.monotonic() < deadline:
        time.sleep(0.01)
    working.send_signal(signal.SIGHUP)
    _, err = working.communicate(timeout=90)
    assert working.returncode == 128 + signal.SIGHUP
    assert err == b""
    assert names() == before


def test_helpers_take_no_module_from_the_working_folder(place):
    """Two seconds are drawn by processes of their own."""
    gesturing(60).save("a.npz")
    for name in ("json.py", "numpy.py", "cospeech.py"):
        Path(name).write_text("raise SystemExit('not this one')", encoding="utf-8")
    script = Path(sys.executable).with_name("cospeech" + (".exe" if os.name == "nt" else ""))
    subprocess.run([script, "render", "a.npz", "a.gif", "-q"], check=True, timeout=60)
    assert Path("a.gif").stat().st_size > 10_000


@posix
def test_a_pipe_as_bone_map(place):
    gesturing(3).save("a.bvh")
    os.mkfifo("map.toml")
    assert "it is a pipe" in refuse(run("convert", "a.bvh", "b.glb", "--map", "map.toml"))


def test_video_is_the_same_every_time(tmp_path):
    """x264's macroblock tree once gave other bytes in about one film of five; eight films show it most of the time."""
    pytest.importorskip("av")
    motion, digests = gesturing(20), set()
    for _ in range(8):
        motion.save(tmp_path / "a.mp4", size=(320, 320))
        digests.add(hashlib.sha256((tmp_path / "a.mp4").read_bytes()).hexdigest())
    assert len(digests) == 1


# --- the library -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_file_without_a_frame_is_not_written(tmp_path, suffix):
    if suffix == ".mp4":
        pytest.importorskip("av")
    with pytest.raises(InputError, match="no motion to write"):
        gesturing(3)[:0].save(tmp_path / f"a{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_lists_and_whole_numbers_make_a_motion():
    given = gesturing(3)
    motion = Motion(30, given.rotations.tolist(), [[0, 1, 0]] * 3, given.face.tolist())  # type: ignore[arg-type]
    assert np.allclose(motion.rotations, given.rotations)
    assert motion.root.dtype == float
    assert motion[1:].duration == pytest.approx(2 / 30)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rotations": None}, "type object"),
        ({"rotations": 3}, "rotations"),
        ({"rotations": [[1], [1, 2]]}, "array"),
        ({"rotations": "turn"}, "type <U4"),
        ({"rotations": 2.0}, "unit length"),
        ({"rotations": 0.0}, "unit length"),
        ({"rotations": 1j}, "type complex"),
        ({"root": np.inf}, "not finite"),
        ({"face": np.nan}, "not finite"),
        ({"fps": None}, "None frames per second"),
        ({"fps": "30"}, "'30' frames per second"),
        ({"fps": np.nan}, "nan frames per second"),
        ({"fps": 1e7}, "frames per second"),
        ({"skeleton": "humanoid"}, "not a skeleton"),
    ],
)
def test_what_is_no_motion(change, message):
    good = gesturing(3)
    values = {"fps": 30, "rotations": good.rotations, "root": good.root, "face": good.face}
    for name, value in change.items():
        is_factor = isinstance(value, float | complex) and name in ("rotations", "root", "face")
        with np.errstate(invalid="ignore"):
            values[name] = values[name] * value if is_factor else value
    with pytest.raises(InputError, match=message):
        Motion(**values)


@pytest.mark.parametrize("fps", [None, "60", 0, -1, np.nan, np.inf, 1e7])
def test_rates_that_motion_cannot_have(fps):
    with pytest.raises(InputError, match="frames per second"):
        gesturing(3).resample(fps)


@pytest.mark.parametrize("target", [None, 3, [], gesturing(1)])
def test_no_skeleton_to_retarget_to(target):
    with pytest.raises(InputError, match="cannot retarget to a"):
        gesturing(3).retarget(target)


@pytest.mark.parametrize("name", [None, 3, b"rules", Path("runs/none")])
def test_no_name_of_a_model(name):
    with pytest.raises(InputError, match="no model is called"):
        cospeech.load(name)


def test_a_skeleton_has_finite_bones():
    with pytest.raises(InputError, match="not finite"):
        cospeech.Skeleton(("hips",), (-1,), np.full((1, 3), np.nan))
