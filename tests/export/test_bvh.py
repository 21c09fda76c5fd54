"""BVH: what we write is re-read by a reader with no code of ours; what others write is read; what is bad is refused."""

from __future__ import annotations

import re
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cospeech.errors import InputError
from cospeech.export import open_writer
from cospeech.export.bvh_reader import UNITS
from cospeech.export.timing import rate_of_step
from cospeech.motion.bone_mapping import recognise
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import (
    continuous_euler,
    euler_to_quat,
    quat_angle,
    quat_continuous,
    quat_identity,
    quat_multiply,
    quat_rotate,
    rotvec_to_quat,
)
from cospeech.motion.skeleton import Skeleton, find_skeleton, humanoid
from tests.support.motions import gesturing

HEADER = """HIERARCHY
ROOT Hips
{
  OFFSET 0 90 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine
  {
    OFFSET 0 10 0
    CHANNELS 3 Xrotation Yrotation Zrotation
    JOINT Head
    {
      OFFSET 1 40 2
      CHANNELS 3 Yrotation Zrotation Xrotation
      End Site
      {
        OFFSET 0 20 0
      }
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.05
"""
ROWS = """1 95 -2 10 20 30 -40 50 60 5 15 25
3 96 -1 -10 70 33 44 -55 66 8 -80 179
"""


def read_plainly(text: str) -> tuple[list[str], np.ndarray, float]:
    """Names, (T, J, 3) joint positions in the file's units, and fps, by another way than ours (scipy's)."""
    head, tail = text.split("MOTION")
    names, parents, offsets, channels, stack, in_end = [], [], [], [], [], False
    for line in head.splitlines():
        words = line.split()
        if words[:1] in (["ROOT"], ["JOINT"]):
            parents.append(stack[-1] if stack else -1)
            names.append(" ".join(words[1:]))
        elif words[:1] == ["End"]:
            in_end = True
        elif words[:1] == ["{"]:
            stack.append(None if in_end else len(names) - 1)
        elif words[:1] == ["}"]:
            in_end = stack.pop() is None and False
        elif words[:1] == ["OFFSET"] and not in_end:
            offsets.append([float(w) for w in words[1:]])
        elif words[:1] == ["CHANNELS"]:
            channels.append(words[2:])
    lines = [line for line in tail.splitlines() if line.strip()]
    rows = np.array([[float(w) for w in line.split()] for line in lines[2:]])
    positions, at = np.zeros((len(rows), len(names), 3)), 0
    world: list[Rotation] = []
    for k, parent in enumerate(parents):
        own = dict(zip(channels[k], rows[:, at : at + len(channels[k])].T, strict=True))
        at += len(channels[k])
        place = np.tile(np.array(offsets[k], float), (len(rows), 1))
        for axis, letter in enumerate("XYZ"):
            if f"{letter}position" in own:
                place[:, axis] = own[f"{letter}position"]
        order = "".join(name[0] for name in own if name.endswith("rotation"))
        angles = np.array([own[f"{a}rotation"] for a in order]).T
        local = Rotation.from_euler(order, angles, degrees=True) if order else Rotation.identity(len(rows))
        world.append(local if parent < 0 else world[parent] * local)
        positions[:, k] = place if parent < 0 else positions[:, parent] + world[parent].apply(place)
    fps = 1 / float(re.search(r"Frame Time:\s*(\S+)", tail)[1])
    return names, positions, fps


def wild(frames: int, skeleton: Skeleton | None = None, seed: int = 0, fps: float = 30.0) -> Motion:
    """Every joint wanders through all orientations."""
    rng, skeleton = np.random.default_rng(seed), skeleton or humanoid()
    steps = rng.normal(0, 0.1, (frames, len(skeleton), 3))
    rotations = rotvec_to_quat(np.cumsum(steps, 0))
    return Motion(fps=fps, rotations=rotations, root=np.cumsum(rng.normal(0, 0.01, (frames, 3)), 0), skeleton=skeleton)


def write_bvh(tmp_path: Path, motion: Motion, **options: object) -> str:
    motion.save(tmp_path / "a.bvh", **options)
    return (tmp_path / "a.bvh").read_text("ascii")


def read(tmp_path: Path, text: str | bytes, **options: object) -> Motion:
    (tmp_path / "b.bvh").write_bytes(text.encode() if isinstance(text, str) else text)
    return Motion.load(tmp_path / "b.bvh", **options)


# --- writing


@pytest.mark.parametrize("name", ["humanoid", "mixamo", "beat", "smplx", "unreal"])
def test_another_reader_finds_the_same_positions(tmp_path, name):
    motion = wild(40, find_skeleton(name))
    names, positions, fps = read_plainly(write_bvh(tmp_path, motion))
    order = [names.index(n) for n in motion.skeleton.names]
    assert np.abs(positions[:, order] - 100 * motion.positions()).max() < 1e-4  # centimetres
    assert fps == pytest.approx(30, rel=1e-7)


@pytest.mark.parametrize("name", ["humanoid", "mixamo", "beat", "smplx", "unreal"])
def test_our_reader_gives_the_same_motion_and_skeleton(tmp_path, name):
    motion = wild(40, find_skeleton(name))
    motion.save(tmp_path / "a.bvh")
    again = Motion.load(tmp_path / "a.bvh")
    assert np.degrees(quat_angle(again.rotations, motion.rotations)).max() < 1e-4
    assert np.abs(again.root - motion.root).max() < 1e-7
    assert again.fps == 30
    assert again.skeleton == motion.skeleton
    assert again.skeleton.kind == name
    leaves = {n for n, below in zip(motion.skeleton.names, motion.skeleton.children, strict=True) if not below}
    assert set(again.skeleton.ends) == leaves
    for leaf in leaves:
        assert np.allclose(again.skeleton.ends[leaf], motion.skeleton.ends.get(leaf, (0, 0, 0)), atol=1e-7)


def test_the_text_is_what_the_interface_promises(tmp_path):
    text = write_bvh(tmp_path, gesturing(31))
    lines = text.splitlines()
    assert lines[:3] == ["HIERARCHY", "ROOT hips", "{"]
    assert lines[3].split() == ["OFFSET", "0.000000", "0.000000", "0.000000"]
    channels = [line.split() for line in lines if "CHANNELS" in line]
    assert [int(c[1]) for c in channels] == [6] + [3] * 54
    assert channels[0][2:5] == ["Xposition", "Yposition", "Zposition"]
    leaves = sum(not below for below in humanoid().children)
    assert sum("End Site" in line for line in lines) == leaves
    at = lines.index("MOTION")
    assert lines[at + 1].split() == ["Frames:", "31"]
    assert lines[at + 2] == "Frame Time: 0.033333333"
    assert len(lines) == at + 3 + 31
    first = lines[at + 3].split()
    assert len(first) == 6 + 54 * 3
    assert 90 < float(first[1]) < 100  # the hips' height, in centimetres
    assert re.fullmatch(r"[-0-9. \n]+", "\n".join(lines[at + 3 :]))  # no nan, inf, exponent or comma
    assert "-0.00000 " not in text


@pytest.mark.slow
def test_pieces_and_whole_give_the_same_bytes(tmp_path):
    motion = wild(1300)
    whole = write_bvh(tmp_path, motion)
    for cuts in ([1, 2, 3, 700, 1299], list(range(0, 1300, 13))):
        with open_writer(tmp_path / "c.bvh", skeleton=motion.skeleton, fps=30) as writer:
            for a, b in zip([0, *cuts], [*cuts, len(motion)], strict=True):
                writer.write(motion[a:b])
        assert (tmp_path / "c.bvh").read_text("ascii") == whole


@pytest.mark.slow
def test_memory_does_not_grow_with_length(tmp_path):
    piece = wild(200)
    peaks = []
    for count in (2, 5):
        tracemalloc.start()
        with open_writer(tmp_path / "c.bvh", skeleton=piece.skeleton, fps=30) as writer:
            for _ in range(count):
                writer.write(piece)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.1 * peaks[0]


def test_curves_have_no_jumps(tmp_path):
    t = np.linspace(0, 6 * np.pi, 400)  # three full turns about each axis, and a swing through the pole
    rotations = quat_identity(400, 55)
    for joint, order in ((1, "X"), (2, "Y"), (3, "Z")):
        rotations[:, joint] = euler_to_quat(t[:, None], order)
    rotations[:, 4] = euler_to_quat(np.stack([0.3 + 0 * t, 1.2 * np.sin(t / 3) + 0.6, 0.2 + 0 * t], 1), "ZXY")
    motion = Motion(fps=30, rotations=quat_continuous(rotations), root=np.zeros((400, 3)))
    rows = np.array([line.split() for line in write_bvh(tmp_path, motion).splitlines()[-400:]], float)
    assert np.abs(np.diff(rows[:, 3:], axis=0)).max() < 5  # 2.7° per frame are real
    assert np.ptp(rows[:, 3:], axis=0).max() == pytest.approx(1080, abs=1)


def test_continuous_angles_are_the_same_rotations():
    rng = np.random.default_rng(0)
    angles = rng.uniform(-np.pi, np.pi, (200, 7, 3))
    first = continuous_euler(angles[:120])
    rest = continuous_euler(angles[120:], first[-1])
    both = np.concatenate([first, rest])
    assert np.array_equal(both, continuous_euler(angles)) or np.allclose(both, continuous_euler(angles), atol=1e-12)
    assert quat_angle(euler_to_quat(both, "ZXY"), euler_to_quat(angles, "ZXY")).max() < 1e-6
    assert np.abs(np.diff(both, axis=0)).max() <= np.pi + 1e-9


def tilt_axes(skeleton: Skeleton, seed: int = 3) -> tuple[Skeleton, np.ndarray]:
    """The same body with bones whose own axes lie anyhow, so that its zero pose is a heap; and the axes (J, 4)."""
    frames = rotvec_to_quat(np.random.default_rng(seed).normal(0, 1.5, (len(skeleton), 3)))
    above = frames[[max(p, 0) for p in skeleton.parents]]
    above[0] = (0, 0, 0, 1)
    inverse = above * (-1, -1, -1, 1)
    offsets = quat_rotate(inverse, skeleton.offsets)
    ends = {n: tuple(quat_rotate(frames[skeleton.index[n]] * (-1, -1, -1, 1), np.array(e))) for n, e in skeleton.ends.items()}
    return replace(skeleton, offsets=offsets, rest=quat_multiply(inverse, frames), ends=ends, kind="custom"), frames


def test_the_zero_pose_of_the_file_is_the_t_pose(tmp_path):
    skeleton, frames = tilt_axes(humanoid())
    assert np.allclose(skeleton.tpose, humanoid().tpose, atol=1e-12)
    motion = wild(20)
    above = frames[[max(p, 0) for p in skeleton.parents]]
    above[0] = (0, 0, 0, 1)
    local = quat_multiply(quat_multiply(above * (-1, -1, -1, 1), motion.rotations), frames)
    same = replace(motion, rotations=local, skeleton=skeleton)
    assert np.allclose(same.positions(), motion.positions(), atol=1e-9)
    assert write_bvh(tmp_path, same) == write_bvh(tmp_path, motion)


def test_metres_on_request(tmp_path):
    names, positions, _ = read_plainly(write_bvh(tmp_path, gesturing(5), units="m"))
    order = [names.index(n) for n in humanoid().names]
    assert np.abs(positions[:, order] - gesturing(5).positions()).max() < 1e-6
    assert np.abs(Motion.load(tmp_path / "a.bvh").positions() - gesturing(5).positions()).max() < 1e-6  # told by height
    with pytest.raises(InputError, match="'ft'"):
        gesturing(5).save(tmp_path / "a.bvh", units="ft")


def test_names_that_bvh_cannot_hold(tmp_path):
    skeleton = Skeleton(("my root", "my\troot", "mixamorig:Arm", "a{b}"), (-1, 0, 1, 2), np.ones((4, 3)))
    names, _, _ = read_plainly(write_bvh(tmp_path, wild(3, skeleton)))
    assert names == ["my_root", "my_root_2", "mixamorig:Arm", "a_b_"]
    assert Motion.load(tmp_path / "a.bvh").skeleton.names == tuple(names)


def test_nothing_is_left_behind(tmp_path):
    with pytest.raises(InputError, match="no frame"), open_writer(tmp_path / "a.bvh", skeleton=humanoid(), fps=30):
        pass
    with (
        pytest.raises(InputError, match="other motion"),
        open_writer(tmp_path / "a.bvh", skeleton=humanoid(), fps=30) as writer,
    ):
        writer.write(gesturing(3, fps=15))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("fps", [15, 20, 23.976, 24, 25, 29.97, 30, 30000 / 1001, 48, 59.94, 60, 90, 120, 7.25])
def test_frame_rates_come_back(tmp_path, fps):
    gesturing(3, fps).save(tmp_path / "a.bvh")
    assert Motion.load(tmp_path / "a.bvh").fps == pytest.approx(fps, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "fps"),
    [("0.0333333", 30), (".03333", 30), ("0.033333", 30), ("0.033", 30), ("0.03", 30), ("0.04", 25), ("0.0416667", 24),
     ("0.041708", 24000 / 1001), ("0.008333", 120), ("0.0083", 120), ("0.008342", 120000 / 1001), ("0.01", 100), ("0.02", 50),
     ("0.016666666666666666", 60), ("1", 1), ("3.333333e-02", 30), ("0.05", 20), ("0.0667", 15), ("0.137", 7.3)],
)  # fmt: skip
def test_frame_rates_behind_rounded_times(tmp_path, text, fps):
    assert read(tmp_path, HEADER.replace("0.05", text) + ROWS).fps == pytest.approx(fps, rel=1e-9)


def test_impossible_frame_times():
    for value in (0.0, -0.03, 1e-6, 1e6):
        with pytest.raises(InputError, match="Frame Time"):
            rate_of_step(value, 1e-6)


@pytest.mark.parametrize("rate", [24, 25, 30, 48, 50, 60, 90, 120, *(rate * 1000 / 1001 for rate in (24, 30, 48, 60, 120))])
@pytest.mark.parametrize("digits", [4, 5, 6, 7, 9])
def test_a_whole_rate_keeps_its_clock_however_it_is_rounded(rate, digits):
    """Of two common rates with the same digits, the whole one is meant: a tenth of a percent is 3.6 s in an hour."""
    step = round(1 / rate, digits)
    back = rate_of_step(step, 10.0**-digits)
    same = round(1 / round(rate), digits) == step
    assert back == pytest.approx(round(rate) if same else rate, rel=1e-9)


# --- reading what others write


def dirty(text: str, kind: str) -> str | bytes:
    """The same file as other exporters would write it."""
    match kind:
        case "crlf":
            return text.replace("\n", "\r\n")
        case "old mac":
            return text.replace("\n", "\r")
        case "tabs and trailing blanks":
            return re.sub(r"^ +", lambda m: "\t" * len(m[0]), text, flags=re.M).replace("\n", " \t\n").replace(": ", ":\t")
        case "byte order mark":
            return b"\xef\xbb\xbf" + text.encode()
        case "frames lie":
            return text.replace("Frames: 2", "Frames: 900")
        case "no end sites":
            return re.sub(r"End Site\s*\{[^}]*\}", "", text)
        case "braces on the line":
            return re.sub(r"\s*\n\s*\{", " {", text)
        case "lower case":
            return text.replace("rotation", "ROTATION").replace("position", "Position").replace("JOINT", "Joint")
        case "blank lines":
            return text.replace("\n", "\n\n") + "\n \n\n"
        case "scientific":
            return text.replace(" 95 ", " 9.5e+001 ").replace(" 15 ", " 1.5E1 ")
        case "no newline at the end":
            return text.rstrip()
    raise AssertionError(kind)


KINDS = ["crlf", "old mac", "tabs and trailing blanks", "byte order mark", "frames lie", "no end sites", "braces on the line",
         "lower case", "blank lines", "scientific", "no newline at the end"]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_dirt_of_other_exporters(tmp_path, kind):
    _, positions, _ = read_plainly(HEADER + ROWS)
    motion = read(tmp_path, dirty(HEADER + ROWS, kind))
    assert np.abs(motion.positions() * 100 - positions).max() < 1e-9
    assert motion.skeleton.names == ("Hips", "Spine", "Head")
    assert motion.fps == 20


def test_rotations_before_positions(tmp_path):
    _, positions, _ = read_plainly(HEADER + ROWS)
    head = HEADER.replace("Xposition Yposition Zposition Zrotation Xrotation Yrotation",
                          "Zrotation Xrotation Yrotation Zposition Xposition Yposition")  # fmt: skip
    rows = "".join(" ".join([*w[3:6], w[2], w[0], w[1], *w[6:]]) + "\n" for w in map(str.split, ROWS.splitlines()))
    assert np.abs(read(tmp_path, head + rows).positions() * 100 - positions).max() < 1e-9


@pytest.mark.parametrize("how", ["instead of the offset", "added to the offset"])
def test_six_channels_on_every_joint(tmp_path, how):
    _, positions, _ = read_plainly(HEADER + ROWS)
    head = re.sub(r"CHANNELS 3 ", "CHANNELS 6 Xposition Yposition Zposition ", HEADER)
    spine, neck = ("0 10 0", "1 40 2") if how.startswith("instead") else ("0 0 0", "0 1e-7 0")
    rows = "".join(" ".join([*w[:6], spine, *w[6:9], neck, *w[9:]]) + "\n" for w in map(str.split, ROWS.splitlines()))
    assert np.abs(read(tmp_path, head + rows).positions() * 100 - positions).max() < 1e-6


def test_root_without_position_channels_stands_at_its_offset(tmp_path):
    head = HEADER.replace("CHANNELS 6 Xposition Yposition Zposition", "CHANNELS 3")
    rows = "".join(" ".join(line.split()[3:]) + "\n" for line in ROWS.splitlines())
    assert np.allclose(read(tmp_path, head + rows).root, [0, 0.9, 0])


def test_names_with_blanks_and_names_that_repeat(tmp_path):
    text = (HEADER + ROWS).replace("JOINT Spine", "JOINT Left Arm ").replace("JOINT Head", "JOINT Hips")
    assert read(tmp_path, text).skeleton.names == ("Hips", "Left_Arm", "Hips_2")
    assert read(tmp_path, (HEADER + ROWS).replace("Spine", "背骨")).skeleton.names[1] == "背骨"
    assert len(read(tmp_path, (HEADER + ROWS).replace("Spine", "R\xfcck").encode("latin-1")).skeleton) == 3


FAULTS = {
    "not a number": (ROWS.replace("70", "nan"), "line 25.*'nan'"),
    "infinite": (ROWS.replace("70", "-inf"), "line 25.*'-inf'"),
    "too large for a double": (ROWS.replace("70", "1e999"), "line 25.*'1e999'"),
    "absurd": (ROWS.replace("70", "1e30"), "line 25.*'1e30'"),
    "underscore": (ROWS.replace("70", "7_0"), "line 25.*'7_0'"),
    "word": (ROWS.replace("70", "abc"), "line 25.*'abc'"),
    "decimal comma": (ROWS.replace("70", "7,0"), "line 25.*'7,0'.*points, not commas"),
    "cut short": (ROWS[:-8], "line 25: 10 values where 12"),
    "one too many": (ROWS.replace("70", "70 70"), "line 25: 13 values where 12"),
    "one too many everywhere": (ROWS.replace("\n", " 0\n"), "line 24: 13 values where 12"),
    "no frames": ("", "no frame"),
    "blank frames": ("\n \n\t\n", "no frame"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_bad_rows_are_named_by_their_line(tmp_path, fault):
    rows, message = FAULTS[fault]
    with pytest.raises(InputError, match=f"'b.bvh', .*{message}") as error:
        read(tmp_path, HEADER + rows)
    assert "\n" not in str(error.value)


HEADS = [
    ("HIERARCHY", "HIERARCHIE", "line 1: 'HIERARCHIE'"),
    ("ROOT Hips", "ROOT", "line 2: a joint without a name"),
    ("ROOT Hips", "JOINT Hips", "line 2"),
    ("JOINT Spine", "ROOT Spine", "line 6.*one character"),
    ("OFFSET 0 10 0", "OFFSET 0 10", "line 8"),
    ("OFFSET 0 10 0", "OFFSET 0 10,5 0", "line 8.*points"),
    ("OFFSET 0 10 0", "OFFSET 0 nan 0", "line 8.*'nan'"),
    ("CHANNELS 3 Xrotation", "CHANNELS 4 Xrotation", "line 9"),
    ("CHANNELS 3 Xrotation", "CHANNELS -3 Xrotation", "line 9"),
    ("CHANNELS 3 Xrotation", "CHANNELS 3 Wrotation", "line 9.*'Wrotation'"),
    ("CHANNELS 3 Xrotation", "CHANNELS 3 Yrotation", "line 9.*twice"),
    ("CHANNELS 3 Xrotation", "CHANNELS 99999999999 Xrotation", "line 9"),
    ("MOTION", "", "'FRAMES:' is out of place"),
    ("}\nMOTION", "MOTION", "line 20: 'MOTION' is out of place"),
    ("}\nMOTION", "}}\nMOTION", "line 20"),
    ("Frame Time: 0.05", "", "'Frame Time:' was expected"),
    ("Frame Time: 0.05", "Frame Time: 0,05", "line 23.*points"),
    ("Frame Time: 0.05", "Frame Time: 0", "Frame Time 0"),
    ("Frame Time: 0.05", "Frame Time:", "line 23"),
    ("Frame Time: 0.05", "Frame Time: 0e99999999999", "Frame Time 0"),
]


@pytest.mark.parametrize(("old", "new", "message"), HEADS)
def test_bad_headers(tmp_path, old, new, message):
    assert old in HEADER
    with pytest.raises(InputError, match=message):
        read(tmp_path, HEADER.replace(old, new) + ROWS)


def test_what_is_no_bvh_at_all(tmp_path):
    for content in (
        b"",
        b"\0" * 5000,
        b"RIFF....WAVE" * 9,
        b"\xff\xfeH\0I\0E\0",
        HEADER[:200].encode(),
        b"HIERARCHY " * 400_000,
    ):
        with pytest.raises(InputError):
            read(tmp_path, content)
    (tmp_path / "folder.bvh").mkdir()
    with pytest.raises(InputError, match="folder"):
        Motion.load(tmp_path / "folder.bvh")
    with pytest.raises(InputError, match="No such file"):
        Motion.load(tmp_path / "absent.bvh")


@pytest.mark.slow
def test_deep_and_wide_trees(tmp_path):
    def chain(count: int) -> str:
        joints = "".join(f"JOINT j{k} {{ OFFSET 0 1 0 CHANNELS 1 Xrotation\n" for k in range(count))
        return f"HIERARCHY ROOT r {{ OFFSET 0 0 0 CHANNELS 1 Xrotation\n{joints}{'}' * (count + 1)}\nMOTION\nFrame Time: 1\n"

    assert len(read(tmp_path, chain(900) + "0 " * 901).skeleton) == 901
    with pytest.raises(InputError, match="more than 5000 joints"):
        read(tmp_path, chain(6000))


# --- units, axes, rest poses


@pytest.mark.parametrize("unit", UNITS)
def test_units_are_told_by_height(tmp_path, unit):
    motion, k = gesturing(4), 0.01 / UNITS[unit]
    ends = {name: tuple(k * x for x in end) for name, end in motion.skeleton.ends.items()}
    skeleton = replace(motion.skeleton, offsets=motion.skeleton.offsets * k, ends=ends)
    in_unit = replace(motion, root=motion.root * k, skeleton=skeleton)
    in_unit.save(tmp_path / "a.bvh")  # now each of the file's numbers is in `unit`
    assert np.abs(Motion.load(tmp_path / "a.bvh").positions() - motion.positions()).max() < 1e-4
    assert np.abs(Motion.load(tmp_path / "a.bvh", units="cm").positions() - k * motion.positions()).max() < 1e-4 * max(k, 1)


def test_bad_options(tmp_path):
    for options in ({"units": "furlong"}, {"up": "x"}):
        with pytest.raises(InputError):
            read(tmp_path, HEADER + ROWS, **options)
    assert read(tmp_path, HEADER.replace("0.05", "0") + ROWS, fps=12).fps == 12


@pytest.mark.parametrize("zero_pose_too", [False, True])
def test_z_up_files(tmp_path, zero_pose_too):
    motion = gesturing(6)
    turn = rotvec_to_quat(np.array([np.pi / 2, 0, 0]))  # Y up → Z up
    rotations, skeleton = motion.rotations.copy(), motion.skeleton
    rotations[:, 0] = quat_multiply(turn, rotations[:, 0])
    root = quat_rotate(turn, motion.root)
    if zero_pose_too:  # every bone's own axes turned as well
        back = turn * (-1, -1, -1, 1)
        rotations = quat_multiply(quat_multiply(turn, motion.rotations), back)
        skeleton = replace(skeleton, offsets=quat_rotate(turn, skeleton.offsets), ends={
            n: tuple(quat_rotate(turn, np.array(e))) for n, e in skeleton.ends.items()})  # fmt: skip
    z_up = Motion(fps=30, rotations=rotations, root=root, skeleton=replace(skeleton, kind="custom"))
    again = read(tmp_path, write_bvh(tmp_path, z_up))
    assert np.abs(again.positions() - motion.positions()).max() < 1e-5
    assert np.allclose(again.skeleton.tpose, motion.skeleton.tpose, atol=1e-5)
    with_z_up = read(tmp_path, write_bvh(tmp_path, z_up), up="y")
    assert np.abs(with_z_up.positions() - quat_rotate(turn, motion.positions())).max() < 1e-5


def zero_pose(turns: dict[str, tuple[float, float, float]]) -> Skeleton:
    """Our humanoid modelled in another pose (degrees about x, y, z in the world), with the identity as its rest."""
    skeleton = humanoid()
    rotations = quat_identity(len(skeleton))
    for name, angles in turns.items():
        rotations[skeleton.index[name]] = euler_to_quat(np.radians(angles), "XYZ")
    points, world = skeleton.forward(rotations, skeleton.offsets[0])
    offsets = points - points[[max(p, 0) for p in skeleton.parents]]
    ends = {n: tuple(quat_rotate(world[skeleton.index[n]], np.array(e))) for n, e in skeleton.ends.items()}
    return replace(skeleton, offsets=offsets, ends=ends, kind="custom")


POSES = {
    "A-pose": {"leftUpperArm": (0, 0, -45), "rightUpperArm": (0, 0, 45)},
    "arms down": {"leftUpperArm": (0, 0, -85), "rightUpperArm": (0, 0, 85)},
    "arms down, elbows bent": {"leftUpperArm": (0, 0, -70), "rightUpperArm": (0, 0, 70), "leftLowerArm": (0, -40, 0)},
    "legs apart": {"leftUpperLeg": (0, 0, 20), "rightUpperLeg": (0, 0, -20), "leftFoot": (0, 0, -20), "rightFoot": (0, 0, 20)},
    "facing away": {"hips": (0, 180, 0)},
    "lying": {"hips": (-90, 0, 0)},
    "palms forward": {"leftLowerArm": (-90, 0, 0), "rightLowerArm": (-90, 0, 0)},
    "arms raised": {"leftUpperArm": (0, 0, 80), "rightUpperArm": (0, 0, -80)},
}


@pytest.mark.parametrize("pose", POSES)
def test_zero_poses_are_brought_to_the_t_pose(tmp_path, pose):
    skeleton = zero_pose(POSES[pose])
    still = Motion(fps=30, rotations=quat_identity(2, 55), root=np.tile(skeleton.offsets[0], (2, 1)), skeleton=skeleton)
    rest = read(tmp_path, write_bvh(tmp_path, replace(still, skeleton=replace(skeleton, rest=None))), up="y").skeleton.tpose
    apart = np.linalg.norm(rest - humanoid().tpose, axis=-1)
    assert apart.max() < 0.02, dict(zip(humanoid().names, apart.round(3), strict=True))


def heap_of_bones() -> tuple[Skeleton, np.ndarray]:
    """Our humanoid with all bones along X in the zero pose, as in Rokoko's files, and the axes of its bones (J, 4)."""
    ours = humanoid()
    along = {"left": (0, 0, 0), "right": (0, 0, np.pi), "leg": (0, 0, -np.pi / 2), "up": (0, 0, np.pi / 2)}
    frames = quat_identity(len(ours))
    for k, name in enumerate(ours.names):
        limb = "leg" if re.search("Leg|Foot|Toes", name) else "left" if name.startswith("left") else "right"
        limb = "up" if name in ("spine", "chest", "upperChest", "neck", "head", "jaw") or "Eye" in name else limb
        frames[k] = rotvec_to_quat(np.array(along[limb])) if name != "hips" else (0, 0, 0, 1)
    above = frames[[max(p, 0) for p in ours.parents]] * (-1, -1, -1, 1)
    above[0] = (0, 0, 0, 1)
    ends = {n: tuple(quat_rotate(frames[ours.index[n]] * (-1, -1, -1, 1), np.array(e))) for n, e in ours.ends.items()}
    return replace(ours, offsets=quat_rotate(above, ours.offsets), ends=ends), frames


def test_a_heap_of_a_zero_pose_is_brought_to_the_t_pose(tmp_path):
    """The zero pose says nothing, so the shape of the body has to be enough."""
    (heap, frames), ours, motion = heap_of_bones(), humanoid(), gesturing(8)
    above = frames[[max(p, 0) for p in ours.parents]] * (-1, -1, -1, 1)
    above[0] = (0, 0, 0, 1)
    local = quat_multiply(quat_multiply(above, motion.rotations), frames)
    text = write_bvh(tmp_path, Motion(fps=30, rotations=local, root=motion.root, skeleton=heap))
    again = read(tmp_path, text)
    assert np.abs(again.positions() - motion.positions()).max() < 1e-5
    names = [n for n in ours.names if not re.search("Thumb|Eye|jaw", n)]
    joints = [ours.index[n] for n in names]
    apart = np.linalg.norm(again.skeleton.tpose[joints] - ours.tpose[joints], axis=-1)
    assert apart.max() < 0.06, dict(zip(names, apart.round(3), strict=True))  # the spine is put straight, ours is bent


# --- the files of others


def files(shared_folder: Path) -> list[Path]:
    paths = sorted((shared_folder / "data" / "bvh").glob("*.bvh"))
    assert len(paths) == 14
    return paths


def test_files_of_fourteen_exporters(tmp_path, shared_folder):
    for path in files(shared_folder):
        motion = Motion.load(path)
        names, positions, _ = read_plainly(path.read_text("utf-8").replace(" \n", "\n"))
        assert motion.skeleton.names == tuple(re.sub(r"\s+", "_", n) for n in names), path.name
        if "makehuman_data_poses" not in path.name:  # its position channels are added to the offsets
            size = np.ptp(positions, axis=(0, 1)).max() / np.ptp(motion.positions(), axis=(0, 1)).max()
            unit = min(UNITS.values(), key=lambda u: abs(1 / u - size))
            ours = motion.positions() / unit
            z_up = ours @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
            assert min(np.abs(ours - positions).max(), np.abs(z_up - positions).max()) < 1e-4, path.name
        motion.save(tmp_path / "a.bvh")
        again = Motion.load(tmp_path / "a.bvh")
        assert again.skeleton.names == motion.skeleton.names
        assert again.fps == pytest.approx(motion.fps, rel=1e-8)
        assert np.abs(again.positions() - motion.positions()).max() < 1e-6, path.name  # metres: 1e-4 cm
        assert np.allclose(again.skeleton.tpose, motion.skeleton.tpose, atol=1e-6), path.name
        again.save(tmp_path / "b.bvh")
        third = Motion.load(tmp_path / "b.bvh")
        assert np.abs(third.positions() - motion.positions()).max() < 2e-6, path.name


def test_t_poses_of_others(shared_folder):
    for path in files(shared_folder):
        skeleton = Motion.load(path).skeleton
        try:
            names = recognise(skeleton)
        except InputError:
            assert path.name in ("fairmotion_sinusoidal.bvh", "pybvh_tests_fixtures_rotation_first_root.bvh")
            continue
        at = {ours: skeleton.tpose[skeleton.index[theirs]] for ours, theirs in names.items()}
        for side, sign in (("left", 1), ("right", -1)):
            arm = at[f"{side}Hand"] - at[f"{side}UpperArm"]
            leg = at[f"{side}Foot"] - at[f"{side}UpperLeg"]
            assert sign * arm[0] > 0.97 * np.linalg.norm(arm), (path.name, side)
            assert -leg[1] > 0.97 * np.linalg.norm(leg), (path.name, side)
            if f"{side}Toes" in at and "test3" not in path.name:
                assert at[f"{side}Toes"][2] > at[f"{side}Foot"][2], (path.name, side)
        assert at["head"][1] > at["hips"][1] + 0.3, path.name
        assert 1.2 < skeleton.tpose[:, 1].max() - skeleton.floor < 2.6, path.name


def test_two_gibibytes_are_refused(tmp_path):
    with (tmp_path / "big.bvh").open("wb") as file:
        file.truncate(3 << 30)  # sparse: takes no room
    with pytest.raises(InputError, match="MiB"):
        Motion.load(tmp_path / "big.bvh")
