"""Maps of joints override names and the shape of the tree; nonsense is refused; a note says what the shape cannot find."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cospeech.errors import CospeechWarning, InputError
from cospeech.export import load, save
from cospeech.motion.bone_mapping import recognise, recognise_file
from cospeech.motion.skeleton import Skeleton, humanoid
from tests.support.motions import gesturing

OURS = humanoid()
THEIRS = {name: f"n{k:02}" for k, name in enumerate(OURS.names)}
FINGER = ("leftIndexProximal", "leftIndexIntermediate", "leftIndexDistal")


@pytest.fixture
def nameless() -> Skeleton:
    """Our humanoid with names that say nothing."""
    ends = {THEIRS[name]: end for name, end in OURS.ends.items()}
    return replace(OURS, names=tuple(THEIRS.values()), ends=ends, kind="custom")


def test_a_partial_map_goes_beside_the_shape(nameless):
    plain = recognise(nameless)
    assert (plain["leftHand"], "leftIndexProximal" in plain) == (THEIRS["leftHand"], False)
    fingers = {name: THEIRS[name] for name in FINGER}
    assert recognise(nameless, fingers) == {name: (plain | fingers)[name] for name in OURS.names if name in plain | fingers}


def test_a_map_wins_over_the_shape(nameless):
    bones = recognise(nameless, {"neck": "", "leftToes": THEIRS["leftFoot"], "leftFoot": ""})
    assert "neck" not in bones
    assert "leftFoot" not in bones
    assert bones["leftToes"] == THEIRS["leftFoot"]


@pytest.mark.parametrize(
    ("bones", "words"),
    [
        ({"head": "hips", "hips": "hips"}, "head and hips are both 'n00'"),
        ({"head": "hips"}, "head = 'n00' is the joint of hips"),
        (
            {"leftUpperArm": "leftLowerArm", "leftLowerArm": "leftUpperArm"},
            "leftLowerArm = '{leftUpperArm}' is not below leftUpperArm = '{leftLowerArm}'",
        ),
        ({"rightLowerLeg": "leftLowerLeg", "leftLowerLeg": "rightLowerLeg"}, "leftLowerLeg = '{rightLowerLeg}' is not below"),
        ({"leftIndexProximal": "rightIndexProximal"}, "leftIndexProximal = '{rightIndexProximal}' is not below leftLowerArm"),
    ],
)
@pytest.mark.parametrize("names", [THEIRS, dict(zip(OURS.names, OURS.names, strict=True))], ids=["by shape", "by names"])
def test_nonsense_is_refused(nameless, bones, words, names):
    skeleton = nameless if names is THEIRS else replace(OURS, kind="custom")
    with pytest.raises(InputError) as error:
        recognise(skeleton, {ours: names[theirs] for ours, theirs in bones.items()})
    assert words.replace("n00", names["hips"]).format(**names) in str(error.value)


def test_the_shape_says_once_what_it_cannot_find(nameless, tmp_path):
    save(replace(gesturing(10), skeleton=nameless), tmp_path / "odd.bvh")
    with pytest.warns(CospeechWarning, match=r"'odd.bvh': .* fingers, eyes, jaw were not found") as record:
        motion = load(tmp_path / "odd.bvh")
    assert len(record) == 1
    assert motion.skeleton.bone_map["leftHand"] == THEIRS["leftHand"]
    motion.retarget("humanoid")  # without a second note: a warning is an error here
    with pytest.warns(CospeechWarning, match="the tree was used; eyes, jaw were not found"):
        load(tmp_path / "odd.bvh", bone_map={name: THEIRS[name] for name in FINGER})
    load(tmp_path / "odd.bvh", bone_map=THEIRS)


def test_the_shape_is_silent_where_nothing_is_left(nameless):
    """A body without fingers and face, as motion capture often has: only tips have no names."""
    absent = {*OURS.left_hand, *OURS.right_hand, *(OURS.index[name] for name in ("leftEye", "rightEye", "jaw"))}
    rest = [k for k in range(len(OURS)) if k not in absent]
    parents = [rest.index(OURS.parents[k]) if k else -1 for k in rest]
    body = Skeleton(tuple(nameless.names[k] for k in rest), tuple(parents), OURS.offsets[rest])
    assert recognise_file(body, None, "'body.bvh'")["leftHand"] == THEIRS["leftHand"]


def test_a_map_of_the_reader_stays_with_the_motion(nameless, tmp_path):
    """A map that was given while a file was read is used again without being given again."""
    save(replace(gesturing(10), skeleton=nameless), tmp_path / "odd.bvh")
    motion = load(tmp_path / "odd.bvh", bone_map=THEIRS)
    assert motion.skeleton.bone_map == THEIRS
    ours, index = motion.retarget("humanoid"), OURS.index
    cosines = abs((ours.rotations * gesturing(10).rotations).sum(-1))
    assert cosines[:, [index["leftLowerArm"], index["leftIndexProximal"]]].min() > 0.999
