"""What goes over the wire, read by receivers that are not ours: python-osc, and parsers written from the specifications."""

from __future__ import annotations

import json
import re
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pythonosc.osc_bundle import OscBundle
from pythonosc.osc_message import OscMessage

from cospeech.export.avatar import load_avatar
from cospeech.export.live import osc
from cospeech.export.live.json_frames import JsonEncoder
from cospeech.export.live.live_link import LiveLinkEncoder
from cospeech.export.live.vmc import VmcEncoder, avatar_offsets
from cospeech.export.live_link_csv import head_and_eyes
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from tests.export.test_avatar import as_vrm0, as_vrm1, rewrite, still  # noqa: F401  a fixture
from tests.support.motions import gesturing

TEXT = st.text(st.characters(blacklist_characters="\0", blacklist_categories=("Cs",)), max_size=20)
FLOATS = st.floats(width=32, allow_nan=False)


@given(TEXT, st.lists(st.one_of(TEXT, st.integers(-(2**31), 2**31 - 1), FLOATS), max_size=9))
def test_a_message_is_read_by_another_library(address, arguments):
    read = OscMessage(osc.message(f"/{address}", *arguments))
    assert (read.address, read.params) == (f"/{address}", arguments)


@given(st.lists(st.integers(0, 200), min_size=1, max_size=40), st.integers(64, 500))
def test_bundles_hold_all_messages_in_order_and_are_no_longer_than_asked(sizes, most):
    messages = [osc.message("/a", "x" * size) for size in sizes]
    bundles = osc.split_bundles(messages, most)
    read = [message.params[0] for data in bundles for message in OscBundle(data)]
    assert read == ["x" * size for size in sizes]
    for data in bundles:
        assert len(data) <= most or OscBundle(data).num_contents == 1


def vmc_frame(packets: list[bytes]) -> dict[str, list]:
    """Address → parameters of each message, of one frame."""
    messages: dict[str, list] = {}
    for packet in packets:
        for message in OscBundle(packet):
            messages.setdefault(message.address, []).append(message.params)
    return messages


def places_in_unity(bones: list, parents: dict[str, str | None]) -> dict[str, np.ndarray]:
    """Forward kinematics in Unity's space, of what a receiver was sent: name → place."""
    local = {name: (np.array(values[:3]), np.array(values[3:])) for name, *values in bones}

    def turn(q: np.ndarray, v: np.ndarray) -> np.ndarray:  # Unity's quaternions multiply as everybody's
        return v + 2 * np.cross(q[:3], np.cross(q[:3], v) + q[3] * v)

    def times(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return np.append(p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3]), p[3] * q[3] - p[:3] @ q[:3])

    world: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for name, (place, rotation) in local.items():
        above = parents[name]
        at, above_turn = world[above] if above else (np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
        world[name] = at + turn(above_turn, place), times(above_turn, rotation)
    return {name: place for name, (place, _) in world.items()}


def unity(name: str) -> str:
    """Our bone → Unity's HumanBodyBones, from Unity's own list: its thumbs begin with Proximal."""
    for ours, theirs in (("ThumbProximal", "ThumbIntermediate"), ("ThumbMetacarpal", "ThumbProximal")):
        name = name.replace(ours, theirs) if name.endswith(ours) else name
    return name[0].upper() + name[1:]


def test_vmc_bones_are_the_mirror_image_that_unity_wants():
    motion, own = gesturing(3), humanoid()
    names = {unity(name): k for k, name in enumerate(own.names)}
    parents = {unity(name): unity(own.names[own.parents[k]]) if k else None for k, name in enumerate(own.names)}
    for k, packets in enumerate(VmcEncoder().frames(motion)):
        frame = vmc_frame(packets)
        assert len(packets) == 1
        assert frame["/VMC/Ext/OK"] == [[1]]
        assert frame["/VMC/Ext/T"][0][0] == pytest.approx(k / motion.fps)
        assert frame["/VMC/Ext/Root/Pos"] == [["root", 0, 0, 0, 0, 0, 0, 1]]
        assert frame["/VMC/Ext/Blend/Apply"] == [[]]
        places = places_in_unity(frame["/VMC/Ext/Bone/Pos"], parents)
        assert set(places) == set(names)
        ours = motion.positions()[k] * [-1, 1, 1]
        for name, joint in names.items():
            np.testing.assert_allclose(places[name], ours[joint], atol=1e-5, err_msg=name)
    assert places["LeftHand"][0] < 0  # in Unity, left is −x


@pytest.mark.parametrize(("face", "name"), [("vrm0", "A"), ("vrm1", "aa"), ("arkit", "JawOpen")])
def test_vmc_blend_shapes_have_the_names_that_are_asked_for(face, name):
    motion = gesturing(2)
    motion.face[:] = 0
    motion.face[1, ARKIT_INDEX["jawOpen"]] = 0.4
    shut, open_face = (dict(vmc_frame(p)["/VMC/Ext/Blend/Val"]) for p in VmcEncoder(face=face).frames(motion))
    assert shut[name] == 0
    assert open_face[name] > 0.35
    assert len(open_face) == {"vrm0": 12, "vrm1": 12, "arkit": 52}[face]
    assert {"Blink", "Blink_L", "I", "U", "E", "O", "Joy", "Angry", "Sorrow"} <= set(open_face) or face != "vrm0"


def test_vmc_packets_are_as_short_as_asked():
    packets = next(iter(VmcEncoder(most=1400).frames(gesturing(1))))
    assert len(packets) > 3
    assert all(len(packet) <= 1400 for packet in packets)
    whole = vmc_frame(next(iter(VmcEncoder().frames(gesturing(1)))))
    assert vmc_frame(packets) == whole


def test_vmc_turns_eyes_once_where_shapes_turn_them():
    motion = gesturing(1)
    motion.rotations[:, humanoid().index["leftEye"]] = [0, 0.6, 0, 0.8]

    def find_left_eye(**settings) -> list[float]:
        frame = vmc_frame(next(iter(VmcEncoder(**settings).frames(motion))))
        return next(values for values in frame["/VMC/Ext/Bone/Pos"] if values[0] == "LeftEye")[4:]

    np.testing.assert_allclose(find_left_eye(face="arkit", still_eyes=True), [0, 0, 0, 1], atol=1e-6)
    for settings in ({"face": "arkit"}, {"face": "vrm0", "still_eyes": True}):  # no shapes of looking are sent
        np.testing.assert_allclose(find_left_eye(**settings), [0, -0.6, 0, 0.8], atol=1e-6)


@pytest.mark.parametrize("change", [as_vrm0, as_vrm1])
def test_vmc_keeps_the_lengths_of_the_avatars_bones(still, tmp_path, change):  # noqa: F811
    def taller(document: dict) -> None:
        change(document)
        for node in document["nodes"][: len(humanoid())]:
            node["translation"] = (1.5 * np.array(node["translation"])).tolist()

    rewrite(still, tmp_path / "theirs.glb", taller)
    offsets = avatar_offsets(load_avatar(tmp_path / "theirs.glb"))
    for k, name in enumerate(humanoid().names):
        np.testing.assert_allclose(offsets[name], 1.5 * humanoid().offsets[k], atol=1e-4, err_msg=name)
    motion = gesturing(2)
    frame = vmc_frame(next(iter(VmcEncoder(rest=offsets).frames(motion))))
    hips = next(values for values in frame["/VMC/Ext/Bone/Pos"] if values[0] == "Hips")
    np.testing.assert_allclose(hips[1:4], motion.root[0] * [-1.5, 1.5, 1.5], atol=1e-4)


def read_live_link(data: bytes) -> dict:
    """A packet of version 6, from its description."""
    (version,) = struct.unpack_from("<I", data)
    identity = data[4:41].decode()
    (length,) = struct.unpack_from("!i", data, 41)
    name = data[45 : 45 + length].decode()
    frame, part, rate, per, count = struct.unpack_from("!IfIIB", data, 45 + length)
    values = struct.unpack_from(f"!{count}f", data, 45 + length + 17)
    assert len(data) == 45 + length + 17 + 4 * count
    return {"version": version, "id": identity, "name": name, "frame": frame, "part": part, "fps": rate / per, "values": values}


@pytest.mark.parametrize("fps", [30.0, 60.0, 29.97])
def test_live_link_packets(fps):
    motion = gesturing(4, fps)
    motion.face[:] = 0
    motion.face[2, ARKIT_INDEX["jawLeft"]], motion.face[2, ARKIT_INDEX["tongueOut"]] = 0.25, 0.5
    packets = [read_live_link(packet) for (packet,) in LiveLinkEncoder("Zoë").frames(motion)]
    assert [p["frame"] for p in packets] == [0, 1, 2, 3]
    for p in packets:
        assert (p["version"], p["name"], len(p["id"]), p["id"][0]) == (6, "Zoë", 37, "$")
        assert p["fps"] == pytest.approx(fps, rel=1e-5)
        assert len(p["values"]) == 61
        assert 0 <= p["part"] < 1e-3
    assert packets[0]["id"] == packets[3]["id"]
    assert packets[2]["values"][15:17] == (0.25, 0)  # JawLeft, then JawRight
    assert packets[2]["values"][51] == 0.5
    np.testing.assert_allclose(packets[2]["values"][52:], head_and_eyes(motion)[2], atol=1e-6)


@pytest.mark.parametrize(
    ("fps", "rate"), [(29.97, 30000 / 1001), (23.976, 24000 / 1001), (59.94, 60000 / 1001), (24, 24), (12.5, 12.5)]
)
def test_live_link_names_rates_of_television_as_unreal_does(fps, rate):
    ((packet,),) = LiveLinkEncoder().frames(gesturing(1, float(fps)))
    assert read_live_link(packet)["fps"] == rate


def test_json_texts_hold_the_motion():
    motion = gesturing(3)
    encoder = JsonEncoder(motion.fps, 1.5, motion.skeleton, face=True)
    start = json.loads(encoder.begin())
    assert (start["type"], start["fps"], start["latency"], start["version"]) == ("start", motion.fps, 1.5, 1)
    assert start["joints"] == list(humanoid().names)
    assert start["face"] == list(ARKIT)
    frames = [json.loads(text) for (text,) in encoder.frames(motion)]
    assert [f["frame"] for f in frames] == [0, 1, 2]
    np.testing.assert_allclose([f["time"] for f in frames], np.arange(3) / motion.fps, atol=1e-6)
    np.testing.assert_allclose([f["rotations"] for f in frames], motion.rotations, atol=1e-5)
    np.testing.assert_allclose([f["root"] for f in frames], motion.root, atol=1e-5)
    np.testing.assert_allclose([f["face"] for f in frames], motion.face, atol=1e-5)
    assert json.loads(encoder.end()) == {"type": "end", "frames": 3}


def test_json_without_a_face():
    motion = gesturing(1)
    body = type(motion)(motion.fps, motion.rotations, motion.root, None, motion.skeleton)
    (text,) = next(iter(JsonEncoder(30, 1, body.skeleton, face=False).frames(body)))
    assert "face" not in json.loads(text)


def test_json_numbers_have_five_digits():
    motion = gesturing(4)
    encoder = JsonEncoder(motion.fps, 1.5, motion.skeleton, face=True)
    texts = [encoder.begin(), *(text for frame in encoder.frames(motion) for text in frame)]
    numbers = [number for text in texts for number in re.findall(rb'(?<!"time":)(?<![\d.e-])-?\d+\.\d+(?:e-?\d+)?', text)]
    assert len(numbers) > 1000
    assert max(len(number.partition(b".")[2]) for number in numbers) == 5
    assert b"-0.0" not in numbers
