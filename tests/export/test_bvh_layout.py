"""A rig's BVH: what is written for it has its HIERARCHY, and its curves can be pasted onto the rig."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from cospeech.audio.speech import example
from cospeech.convert import Edits, convert_file
from cospeech.errors import CospeechWarning
from cospeech.export import load, open_writer, save
from cospeech.export.bvh_hierarchy import file_names
from cospeech.export.target_skeleton import find_target
from cospeech.generate import generate_files
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import euler_to_quat, quat_angle, quat_rotate
from cospeech.motion.skeleton import Skeleton, humanoid
from tests.export.test_bvh import POSES, files, heap_of_bones, read_plainly, zero_pose
from tests.support.motions import gesturing

PLACE = ["Xposition", "Yposition", "Zposition"]
TO_Z_UP = euler_to_quat(np.array([np.pi / 2]), "X")
Channels = Callable[[int, str], list[str]]


def turns(order: str) -> list[str]:
    return [f"{axis}rotation" for axis in order]


def usual(joint: int, name: str) -> list[str]:
    return [*([] if joint else PLACE), *turns("ZXY")]


@dataclass
class Rig:
    """What a file of somebody's rig is made of: its zero pose, units per metre, channels, and up."""

    skeleton: Skeleton
    scale: float = 100.0
    channels: Channels = usual
    z_up: bool = False
    prefix: str = "my:"
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reverse: bool = False

    def text(self) -> str:
        """The file, with one frame in the zero pose."""
        body, row = self.skeleton, []
        turn = TO_Z_UP if self.z_up else np.array([0.0, 0, 0, 1])
        offsets = quat_rotate(turn, np.concatenate([humanoid().offsets[:1], body.offsets[1:]])) * self.scale

        def joint(k: int) -> str:
            channels = self.channels(k, body.names[k])
            row.extend(offsets[k, "XYZ".index(c[0])] if c.endswith("position") else 0.0 for c in channels)
            offset = self.offset if k == 0 else offsets[k]
            lines = [
                f"{'JOINT' if k else 'ROOT'} {self.prefix}{body.names[k]} {{",
                "OFFSET {:.7f} {:.7f} {:.7f}".format(*offset),
            ]
            lines.append(f"CHANNELS {len(channels)} {' '.join(channels)}")
            if body.names[k] in body.ends:
                end = quat_rotate(turn, np.array(body.ends[body.names[k]])) * self.scale
                lines.append("End Site {{ OFFSET {:.7f} {:.7f} {:.7f} }}".format(*end))
            return "\n".join([*lines, *map(joint, body.children[k][:: -1 if self.reverse else 1]), "}"])

        tree = joint(0).replace("{", "\n{\n").replace(" }", "\n}")
        return f"HIERARCHY\n{tree}\nMOTION\nFrames: 1\nFrame Time: 0.04\n{' '.join(f'{v:.7f}' for v in row)}\n"


def mix_orders(joint: int, name: str) -> list[str]:
    """Orders that differ from joint to joint, and the root's positions after its rotations, in another order."""
    own = turns(("XYZ", "ZYX", "ZXY", "YXZ")[joint % 4])
    return own if joint else [*own, "Zposition", "Xposition", "Yposition"]


RIGS = {
    "centimetres, A-pose": Rig(zero_pose(POSES["A-pose"])),
    "inches, arms down, XYZ": Rig(
        zero_pose(POSES["arms down"]), 1 / 0.0254, lambda k, _: [*([] if k else PLACE[::-1]), *turns("XYZ")], offset=(1, 2, 3)
    ),
    "metres, bones along one axis, mixed orders": Rig(heap_of_bones()[0], 1.0, mix_orders),
    "decimetres, positions of all joints, ZYX": Rig(zero_pose(POSES["legs apart"]), 10.0, lambda k, _: [*PLACE, *turns("ZYX")]),
    "centimetres, Z up, mixed orders": Rig(zero_pose(POSES["A-pose"]), 100.0, mix_orders, z_up=True),
    "millimetres, facing away": Rig(zero_pose(POSES["facing away"]), 1000.0),
    "our names in another order of joints": Rig(humanoid(), 100.0, mix_orders, prefix="", reverse=True),
}


def words(text: str) -> list[str | float]:
    """The HIERARCHY section; numbers as numbers."""
    number = re.compile(r"[-+\d.]+(e[-+]?\d+)?$", re.IGNORECASE)
    parts = text.split("MOTION")[0].replace("{", " { ").replace("}", " } ").split()
    return [float(word) if number.match(word) else word for word in parts]


def paste(rig: str, text: str) -> str:
    """The MOTION block of a file on the HIERARCHY of a rig."""
    return rig[: rig.index("MOTION")] + text[text.index("MOTION") :]


def check_paste(rig: str, text: str, motion: Motion, tolerance: float = 1e-5) -> np.ndarray:
    """Assert that pasted curves give the poses of a motion; (T, J, 3) pasted joints in metres and our axes, in its order."""
    assert words(text) == words(rig)
    names, places, _ = read_plainly(paste(rig, text))
    assert np.array_equal(places, read_plainly(text)[1])
    layout = motion.skeleton.layout
    points = places / layout.scale
    points = points if layout.turn is None else quat_rotate(layout.turn * (-1, -1, -1, 1), points)
    points = points[:, [file_names(names).index(name) for name in motion.skeleton.names]]
    assert np.abs(points - motion.positions()).max() < tolerance
    return points


@pytest.fixture(params=RIGS)
def rig(request, tmp_path):
    path = tmp_path / "my_rig.bvh"
    path.write_text(RIGS[request.param].text())
    return path


def test_curves_can_be_pasted_onto_the_rig(rig, tmp_path):
    motion = gesturing(30)
    save(motion, tmp_path / "talk.bvh")
    there = convert_file(tmp_path / "talk.bvh", tmp_path / "out.bvh", skeleton=rig)
    points = check_paste(rig.read_text(), (tmp_path / "out.bvh").read_text(), there)
    assert len(points) == 30
    prefix = there.skeleton.names[0].removesuffix("hips")
    for upper, lower in (("UpperArm", "LowerArm"), ("LowerArm", "Hand"), ("UpperLeg", "LowerLeg")):
        for side in ("left", "right"):  # the poses are those of the speaker, not only those that our reader sees
            a, b = (motion.positions()[:, humanoid().index[side + part]] for part in (upper, lower))
            c, d = (points[:, there.skeleton.index[prefix + side + part]] for part in (upper, lower))
            assert (
                np.abs(
                    (b - a) / np.linalg.norm(b - a, axis=-1)[:, None] - (d - c) / np.linalg.norm(d - c, axis=-1)[:, None]
                ).max()
                < 2e-3
            )


@pytest.mark.slow
@pytest.mark.parametrize("name", list(RIGS)[1:3])
def test_generated_curves_can_be_pasted_too(name, tmp_path):
    path, (sound, transcript) = tmp_path / "my_rig.bvh", example()
    path.write_text(RIGS[name].text())
    generate_files(sound, [tmp_path / "a.bvh", tmp_path / "a.npz"], transcript=transcript, skeleton=path)
    text = (tmp_path / "a.bvh").read_text()
    assert words(text) == words(path.read_text())
    hands = []
    for motion in (load(tmp_path / "a.bvh"), load(tmp_path / "a.npz").retarget(find_target(path))):  # .npz has our own joints
        hands.append(motion.positions()[:, motion.skeleton.index["my:leftHand" if name[0] == "i" else "my:rightHand"]])
    assert np.abs(hands[0] - hands[1]).max() < 0.01
    assert np.ptp(hands[0], axis=0).max() > 0.1


def test_a_file_keeps_its_layout_when_it_is_edited(rig, tmp_path):
    save(gesturing(30).retarget(find_target(rig)), tmp_path / "walk.bvh")
    text = (tmp_path / "walk.bvh").read_text()
    rows = np.array([line.split() for line in text.splitlines()[-30:]], float)
    cut = convert_file(tmp_path / "walk.bvh", tmp_path / "cut.bvh", edits=Edits(start=0.5))
    assert words((tmp_path / "cut.bvh").read_text()) == words(text)
    again = np.array([line.split() for line in (tmp_path / "cut.bvh").read_text().splitlines()[-15:]], float)
    assert np.abs(np.sin(np.radians(again - rows[15:]) / 2)).max() < 1e-5  # as numbers, but for whole turns
    assert len(cut) == 15


def test_a_unit_wins_over_the_layout_of_the_file(rig, tmp_path):
    motion = gesturing(5).retarget(find_target(rig))
    motion.save(tmp_path / "a.bvh", units="cm")
    replace(motion, skeleton=replace(motion.skeleton, layout=None)).save(tmp_path / "b.bvh")
    assert (tmp_path / "a.bvh").read_bytes() == (tmp_path / "b.bvh").read_bytes()
    assert "OFFSET 0.000000 0.000000 0.000000" in (tmp_path / "a.bvh").read_text()
    motion.save(tmp_path / "c.npz")
    replace(motion, skeleton=replace(motion.skeleton, layout=None)).save(tmp_path / "d.npz")
    assert np.array_equal(load(tmp_path / "c.npz").rotations, load(tmp_path / "d.npz").rotations)


def test_other_bones_or_names_than_the_file_has_are_written_in_our_layout(tmp_path):
    (tmp_path / "rig.bvh").write_text(RIGS["inches, arms down, XYZ"].text())
    motion = gesturing(5).retarget(find_target(tmp_path / "rig.bvh"))
    names = tuple(name.removeprefix("my:") for name in motion.skeleton.names)
    for change in ({"offsets": 1.1 * motion.skeleton.offsets}, {"names": names}):
        other = replace(motion, skeleton=replace(motion.skeleton, **change))
        other.save(tmp_path / "a.bvh")
        names_of_file, points, _ = read_plainly((tmp_path / "a.bvh").read_text())
        assert np.abs(points[:, [names_of_file.index(n) for n in other.skeleton.names]] - 100 * other.positions()).max() < 1e-3


def test_an_equal_skeleton_gets_the_layout_of_the_rig(tmp_path):
    """A take of the same character from another exporter."""
    rigs = [
        replace(RIGS["centimetres, A-pose"], scale=scale, channels=channels)
        for scale, channels in ((1, mix_orders), (100, usual))
    ]
    for name, each in zip(("rig", "take"), rigs, strict=True):
        (tmp_path / f"{name}.bvh").write_text(each.text())
    assert load(tmp_path / "take.bvh").skeleton == find_target(tmp_path / "rig.bvh")
    there = convert_file(tmp_path / "take.bvh", tmp_path / "out.bvh", skeleton=tmp_path / "rig.bvh")
    check_paste((tmp_path / "rig.bvh").read_text(), (tmp_path / "out.bvh").read_text(), there)


FEW = {"LowerArm": "Y", "Hand": "XZ", "LowerLeg": "X", "Toes": ""}


def few(joint: int, name: str) -> list[str]:
    """Elbows and knees are hinges, wrists have two axes, toes none."""
    part = name.removeprefix("left").removeprefix("right")
    return turns(FEW[part]) if part in FEW else usual(joint, name)


@pytest.fixture
def hinges(tmp_path):
    (tmp_path / "hinges.bvh").write_text(Rig(humanoid(), channels=few).text())
    return tmp_path / "hinges.bvh"


def test_joints_with_few_channels_hold_what_they_can(hinges, tmp_path):
    motion = gesturing(40).retarget(find_target(hinges))
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # its elbows bend about Y, its wrists about Z: nothing is lost
        motion.save(tmp_path / "out.bvh")
    check_paste(hinges.read_text(), (tmp_path / "out.bvh").read_text(), motion)


def test_what_few_channels_cannot_hold_is_told_and_goes_on_to_the_children(hinges, tmp_path):
    motion = gesturing(40).retarget(find_target(hinges))
    rotations, elbow = motion.rotations.copy(), motion.skeleton.index["my:leftLowerArm"]
    angles = np.stack([np.linspace(0.2, 0.9, 40), np.linspace(0, 0.4, 40)], 1)
    rotations[:, elbow] = euler_to_quat(angles, "YX")  # a forearm that turns about itself by up to 23°
    twist = replace(motion, rotations=rotations)
    with pytest.warns(CospeechWarning, match=r"too few channels.*my:leftLowerArm by up to 23°") as notes:
        twist.save(tmp_path / "out.bvh")
    assert len(notes) == 1
    assert "right" not in str(notes[0].message)
    text = (tmp_path / "out.bvh").read_text()
    assert words(text) == words(hinges.read_text())
    again = load(tmp_path / "out.bvh")
    apart = quat_angle(
        again.skeleton.forward(again.rotations, again.root)[1], twist.skeleton.forward(rotations, motion.root)[1]
    )
    hand, finger = (motion.skeleton.index[f"my:left{part}"] for part in ("Hand", "MiddleProximal"))
    assert np.degrees(apart[:, elbow].max()) == pytest.approx(np.degrees(0.4), abs=0.1)
    assert np.degrees(apart[:, hand].max()) < 1.0  # the wrist takes the turn, as X is one of its axes
    assert np.degrees(apart[:, finger].max()) < 1e-3  # three channels hold the rest
    assert np.abs(again.positions()[:, hand] - twist.positions()[:, hand]).max() < 1e-5


def test_a_root_without_positions_is_told(tmp_path):
    (tmp_path / "rig.bvh").write_text(Rig(humanoid(), channels=lambda k, _: turns("ZXY"), offset=(0, 90, 0)).text())
    with pytest.warns(CospeechWarning, match=r"the place of the root by up to 0\.0[0-9] m"):
        gesturing(40).retarget(find_target(tmp_path / "rig.bvh")).save(tmp_path / "out.bvh")
    assert words((tmp_path / "out.bvh").read_text()) == words((tmp_path / "rig.bvh").read_text())


def test_pieces_are_written_as_the_whole_is(hinges, tmp_path):
    motion = gesturing(40).retarget(find_target(hinges))
    motion.save(tmp_path / "whole.bvh")
    with open_writer(tmp_path / "pieces.bvh", skeleton=motion.skeleton, fps=30) as writer:
        for a, b in ((0, 1), (1, 2), (2, 19), (19, 40)):
            writer.write(motion[a:b])
    assert (tmp_path / "pieces.bvh").read_bytes() == (tmp_path / "whole.bvh").read_bytes()


@pytest.mark.slow
def test_curves_can_be_pasted_onto_the_rigs_of_many_exporters(shared_folder, tmp_path):
    motion, count = gesturing(10), 0
    for path in [*files(shared_folder), *sorted((shared_folder / "data" / "mocap_cmu").glob("*.bvh"))[::7]]:
        if path.name in ("fairmotion_sinusoidal.bvh", "pybvh_tests_fixtures_rotation_first_root.bvh"):
            continue  # no people
        raw = path.read_text("utf-8").replace(" \n", "\n")
        there = motion.retarget(find_target(path))
        there.save(tmp_path / "out.bvh")
        text = (tmp_path / "out.bvh").read_text()
        if path.name == "makehuman_data_poses_tpose.bvh":  # its position channels are added to the offsets
            assert words(text) == words(raw)
            continue
        check_paste(raw, text, there)
        count += 1
    assert count == 14


@pytest.mark.slow
def test_files_of_many_exporters_keep_their_layout(shared_folder, tmp_path):
    for path in files(shared_folder):
        raw = path.read_text("utf-8").replace(" \n", "\n")
        load(path).save(tmp_path / "a.bvh")
        text = (tmp_path / "a.bvh").read_text()
        assert words(text) == words(raw), path.name
        assert np.abs(read_plainly(text)[1] - read_plainly(raw)[1]).max() < 1e-4, path.name


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252"])
def test_names_with_accents_are_those_of_the_rig_in_every_encoding(tmp_path, encoding):
    """Programs on Windows write names as Windows does; a file of ours is always in UTF-8."""
    text = Rig(humanoid(), prefix="Prénom:").text()
    (tmp_path / "rig.bvh").write_bytes(text.encode(encoding))
    motion = load(tmp_path / "rig.bvh")
    assert all(name.startswith("Prénom:") for name in motion.skeleton.names)
    assert motion.skeleton.bone_map
    save(motion, tmp_path / "again.bvh")
    assert "ROOT Prénom:" in (tmp_path / "again.bvh").read_text("utf-8")
