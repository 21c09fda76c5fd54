"""Axes, types and followers of URDFs as exporters write them."""

from __future__ import annotations

import pytest

from cospeech.errors import InputError
from cospeech.motion.robot import read_urdf, urdf_axes
from cospeech.motion.robot.urdf import list_joints

ENDS = '<limit lower="-1.5" upper="1.5" velocity="3"/>'


def write(folder, *joints: str):
    (folder / "r.urdf").write_text(f'<robot name="r">{"".join(joints)}</robot>')
    return folder / "r.urdf"


def joint(name: str, axis: str, *, rpy: str = "0 0 0", parent: str = "base", kind: str = "revolute", more: str = "") -> str:
    links = f'<parent link="{parent}"/><child link="{name}_link"/>'
    return f'<joint name="{name}" type="{kind}"><origin rpy="{rpy}"/>{links}<axis xyz="{axis}"/>{ENDS}{more}</joint>'


@pytest.mark.parametrize(
    ("axis", "rpy", "sign"),
    [
        ("0 1 0", "0 0 0", 1), ("0 -1 0", "0 0 0", -1), ("6.1e-17 -1 0", "0 0 0", -1), ("0 0 -1", "1.5707963 0 0", 1),
        ("0 0 1", "1.5707963 0 0", -1), ("0 0 1", "-1.5707963 0 0", 1), ("1 0 0", "0 0 1.5707963", 1), ("0 2 0.1", "0 0 0", 1),
    ],
)  # fmt: skip
def test_directions_count_in_the_frame_of_the_base(tmp_path, axis, rpy, sign):
    assert read_urdf(write(tmp_path, joint("LShoulderPitch", axis, rpy=rpy)))[0].sign == sign


def test_origins_turn_all_frames_after_them(tmp_path):
    torso = joint("mount", "0 0 1", rpy="0 0 3.14159265", kind="fixed")
    pitch = joint("LShoulderPitch", "0 1 0", parent="mount_link")
    roll = joint("LShoulderRoll", "1 0 0", parent="LShoulderPitch_link", rpy="0 -1.5707963 0")
    assert [each.sign for each in read_urdf(write(tmp_path, torso, pitch, roll))] == [-1, 1]


def test_fixed_joints_without_names_turn_frames_too(tmp_path):
    torso = joint("mount", "0 0 0", rpy="0 0 3.14159265", kind="fixed").replace(' name="mount"', "")
    other = joint("camera", "0 0 1", kind="fixed").replace(' name="camera"', "")
    root = joint("root", "0 0 0", kind="floating", parent="world").replace('"root_link"', '"base"')
    pitch = joint("LShoulderPitch", "0 1 0", parent="mount_link")
    again = joint("LShoulderPitch", "0 1 0", kind="fixed").replace("LShoulderPitch_link", "x")
    assert [each.sign for each in read_urdf(write(tmp_path, root, torso, pitch, other, again))] == [-1]


def test_a_joint_that_turns_about_another_axis_is_not_recognised(tmp_path):
    joints = read_urdf(write(tmp_path, joint("HeadYaw", "0 0 1"), joint("HeadPitch", "1 0 0"), joint("LElbowRoll", "1 1 1")))
    assert [each.name for each in joints] == ["HeadYaw", "LElbowRoll"]  # of an oblique axis nothing is known
    assert len(read_urdf(tmp_path / "r.urdf", {"HeadPitch": "head_pitch"})) == 3


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (joint("HeadYaw", "0 0 0"), "an axis of no length"), (joint("HeadYaw", "0 1"), "xyz='0 1', which is no three numbers"),
        (joint("HeadYaw", "0 0 1", rpy="0 0"), "rpy='0 0', which is no three numbers"),
        (joint("HeadYaw", "0 0 nan"), "no three numbers"),
        (joint("HeadYaw", "0 0 1", kind="revolut"), "did you mean 'revolute'"),
        (joint("HeadYaw", "0 0 1").replace(' type="revolute"', ""), "has no type"), (joint("", "0 0 1"), "has no name"),
        (joint("HeadYaw", "0 0 1") + joint("b", "0 0 1", more='<mimic joint="Nope"/>'), "'b' mimics 'Nope'"),
        (joint("HeadYaw", "0 0 1") + joint("b", "0 0 1", more='<mimic joint="b"/>'), "'b' mimics 'b'"),
        (joint("HeadYaw", "0 0 1", parent="HeadYaw_link"), "go in a circle"),
    ],
)  # fmt: skip
def test_what_no_urdf_says(tmp_path, text, what):
    with pytest.raises(InputError, match=what):
        read_urdf(write(tmp_path, text))


def test_a_document_type_is_refused_in_any_encoding(tmp_path):
    text = f'<?xml version="1.0" encoding="utf-16"?><!DOCTYPE r [<!ENTITY a "b">]><robot>{joint("&a;", "0 0 1")}</robot>'
    (tmp_path / "r.urdf").write_bytes(text.encode("utf-16"))
    with pytest.raises(InputError, match="has a document type"):
        list_joints(tmp_path / "r.urdf")


def test_a_chain_of_joints_is_gone_through_once(tmp_path, monkeypatch):
    """From each joint to the base, the work of a chain grew with the square of its length: 400 joints took seconds."""
    chain = [joint(f"j{k}", "0 0 1", parent=f"j{k - 1}_link", rpy="0 0 1.5707963") for k in range(1, 40)]
    last = joint("LShoulderPitch", "0 1 0", parent="j39_link", rpy="0 0 1.5707963")
    looks, plain = [], urdf_axes.euler_to_quat
    monkeypatch.setattr(urdf_axes, "euler_to_quat", lambda *given: looks.append(1) or plain(*given))
    assert [each.sign for each in read_urdf(write(tmp_path, *chain, last))] == [1], "ten whole turns"
    assert len(looks) == 40


def test_what_is_no_urdf(tmp_path):
    (tmp_path / "r.xml").write_text("<mujoco><body/></mujoco>")
    with pytest.raises(InputError, match="it begins with <mujoco>"):
        read_urdf(tmp_path / "r.xml")


def test_joints_of_transmissions_and_simulators_are_none(tmp_path):
    path = write(tmp_path, joint("HeadYaw", "0 0 1"), '<transmission><joint name="HeadYaw"/></transmission>')
    assert [each.name for each in read_urdf(path)] == ["HeadYaw"]


def test_a_leader_keeps_the_limits_of_those_that_follow_it(tmp_path):
    ends = '<limit lower="0" upper="0.5" velocity="1"/>'
    finger = joint("finger", "1 0 0", more='<mimic joint="LHand" multiplier="2" offset="0.1"/>').replace(ENDS, ends)
    (hand,) = read_urdf(write(tmp_path, joint("LHand", "1 0 0"), finger))
    assert (hand.lower, hand.upper, hand.velocity) == pytest.approx((-0.05, 0.2, 0.5))
    back = joint("finger", "1 0 0", more='<mimic joint="LHand" multiplier="-1"/>').replace(ENDS, ends)
    (hand,) = read_urdf(write(tmp_path, joint("LHand", "1 0 0"), back))
    assert (hand.lower, hand.upper, hand.velocity) == pytest.approx((-0.5, 0.0, 1.0))
    assert hand.acceleration == pytest.approx(8.0)
    free = joint("finger", "1 0 0", more='<mimic joint="LHand"/>').replace(ENDS, '<limit effort="1" velocity="2"/>')
    (hand,) = read_urdf(write(tmp_path, joint("LHand", "1 0 0"), free))
    assert (hand.lower, hand.upper, hand.velocity) == (-1.5, 1.5, 2.0)
    nowhere = joint("finger", "1 0 0", more='<mimic joint="LHand" offset="9"/>').replace(ENDS, ends)
    with pytest.raises(InputError, match="whose limits let it be nowhere"):
        read_urdf(write(tmp_path, joint("LHand", "1 0 0"), nowhere))
