"""Characters whose joints have names that say nothing: a map reaches them; clips that a file has, and those that are lost."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
import soundfile

from cospeech.audio.speech import example
from cospeech.convert import convert_file
from cospeech.errors import CospeechWarning, InputError
from cospeech.export import load, save
from cospeech.export.avatar import load_avatar
from cospeech.export.avatar_character import load_character
from cospeech.export.checks import check_avatar
from cospeech.export.gltf import read_glb
from cospeech.export.target_skeleton import find_target
from cospeech.generate import generate_files
from cospeech.motion.skeleton import humanoid
from tests.export.test_avatar import as_vrm1, rewrite, still, world_at  # noqa: F401  a fixture
from tests.support.command_line import type_command
from tests.support.motions import gesturing

NAMES = {name: f"n{k:02}" for k, name in enumerate(humanoid().names)}


def as_odd(document: dict) -> None:
    """Names that say nothing, and four limbs that nobody has, so that the shape says nothing either."""
    nodes = document["nodes"]
    for k, name in enumerate(NAMES.values()):
        nodes[k]["name"] = name
    for limb in range(4):
        for k in range(4):
            nodes.append({"name": f"limb {limb} {k}", "translation": [0.2 * (-1) ** limb, 0.3, 0.1 * (limb // 2)]})
            nodes[len(nodes) - 2 if k else 0].setdefault("children", []).append(len(nodes) - 1)
            document["skins"][0]["joints"].append(len(nodes) - 1)
    document["skins"][0].pop("inverseBindMatrices")


def as_nameless(document: dict) -> None:
    for k, name in enumerate(NAMES.values()):
        document["nodes"][k]["name"] = name


@pytest.fixture
def odd(still, tmp_path):  # noqa: F811
    """A character in which nothing is recognised, and a map of it."""
    rewrite(still, tmp_path / "odd.glb", as_odd)
    (tmp_path / "map.toml").write_text("[bones]\n" + "\n".join(f'{ours} = "{theirs}"' for ours, theirs in NAMES.items()))
    return tmp_path / "odd.glb", tmp_path / "map.toml"


@pytest.mark.slow
def test_a_map_reaches_the_clip_of_the_style(tmp_path):
    """A clip of joints whose names say nothing; without the map, a note would say that fingers are lost."""
    sound, clip = example()[0], gesturing(200)
    save(clip, tmp_path / "known.bvh")
    text = (tmp_path / "known.bvh").read_text()
    for name in sorted(NAMES, key=len, reverse=True):
        text = re.sub(rf"\b(ROOT|JOINT) {name}\b", rf"\1 {NAMES[name]}", text)
    (tmp_path / "odd.bvh").write_text(text)
    (tmp_path / "map.toml").write_text("[bones]\n" + "\n".join(f'{ours} = "{theirs}"' for ours, theirs in NAMES.items()))
    options = {"model": "mix-stage", "parts": ("body",)}
    generate_files(sound, [tmp_path / "a.bvh"], style=load(tmp_path / "odd.bvh", bone_map=NAMES), **options)
    options |= {"style": tmp_path / "odd.bvh", "bone_map": tmp_path / "map.toml"}
    with warnings.catch_warnings():
        warnings.simplefilter("error", CospeechWarning)
        report = generate_files(sound, [tmp_path / "b.bvh"], **options)
    assert (tmp_path / "a.bvh").read_bytes() == (tmp_path / "b.bvh").read_bytes()
    assert report.style == str(tmp_path / "odd.bvh")


def assert_moves(path, motion) -> None:
    """The left hand of a GLB goes where that of a motion goes."""
    file, index = read_glb(path), humanoid().index
    for frame in (0, len(motion) - 1):
        theirs, ours = world_at(file, frame / motion.fps), motion.positions()[frame]
        arm = theirs[NAMES["leftHand"]] - theirs[NAMES["leftUpperArm"]]
        np.testing.assert_allclose(arm, ours[index["leftHand"]] - ours[index["leftUpperArm"]], atol=2e-3)


def test_an_avatar_that_is_not_recognised_is_named(odd):
    with pytest.raises(InputError, match=r"odd.glb'?: cannot find hips, head"):
        load_avatar(odd[0])
    with pytest.raises(InputError, match=r"the map does not fit: 'n7' is none of their joints, did you mean 'n\d7'"):
        load_avatar(odd[0], {**NAMES, "neck": "n7"})


def test_convert_takes_the_map_of_an_avatar(odd, tmp_path):
    motion = gesturing(20)
    save(motion, tmp_path / "a.npz")
    convert_file(tmp_path / "a.npz", tmp_path / "b.glb", avatar=odd[0], names=odd[1])
    assert_moves(tmp_path / "b.glb", motion)
    back = load(tmp_path / "b.glb", bone_map=NAMES).retarget("humanoid")
    index = humanoid().index["leftLowerArm"]
    assert np.abs((back.rotations * motion.rotations).sum(-1))[:, index].min() > 0.999
    convert_file(tmp_path / "b.glb", tmp_path / "c.vrma", names=odd[1])
    assert len(load(tmp_path / "c.vrma")) == 20


def test_pictures_take_the_map_of_an_avatar(odd, tmp_path):
    save(gesturing(3), tmp_path / "a.bvh")
    convert_file(tmp_path / "a.bvh", tmp_path / "a.png", avatar=odd[0], names=odd[1])
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    there = load_character(odd[0], NAMES).skeleton
    assert there.index["leftHand"] == humanoid().index["leftHand"]


def test_an_avatar_without_a_face_is_told_of(still, tmp_path):  # noqa: F811
    def faceless(document: dict) -> None:
        document["meshes"] = [mesh | {"extras": {}} for mesh in document["meshes"]]
        for node in document["nodes"]:
            if node.get("name") in ("leftEye", "rightEye", "jaw"):
                node["name"] = "bead"

    rewrite(still, tmp_path / "me.glb", faceless)
    with pytest.warns(CospeechWarning, match="'?me.glb'? has no face that can be driven: its body alone moves"):
        check_avatar(tmp_path / "me.glb", {".glb"}, parts=("face", "body"))
    with pytest.raises(InputError, match=r"so it would not move .leave --parts out"):
        check_avatar(tmp_path / "me.glb", {".glb"}, parts=("face",))
    check_avatar(still, {".glb"}, parts=("face",))


@pytest.mark.slow
def test_generate_takes_the_map_of_an_avatar(odd, tmp_path):
    sound = tmp_path / "talk.wav"
    soundfile.write(sound, 0.1 * np.sin(np.arange(16000) * 0.05), 16000)
    generate_files(sound, [tmp_path / "a.glb", tmp_path / "a.npz"], avatar=odd[0], bone_map=odd[1])
    assert len(load(tmp_path / "a.glb", bone_map=NAMES)) == len(load(tmp_path / "a.npz"))
    generate_files(sound, [tmp_path / "a.bvh"], skeleton=odd[0], bone_map=odd[1])
    assert load(tmp_path / "a.bvh", bone_map=NAMES).skeleton.names[0] == NAMES["hips"]


def test_a_map_of_another_file_stays_for_that(odd, still, tmp_path):  # noqa: F811
    save(gesturing(3), tmp_path / "a.bvh")
    convert_file(tmp_path / "a.bvh", tmp_path / "b.bvh", skeleton=odd[0], names=odd[1])
    assert load(tmp_path / "b.bvh", bone_map=NAMES).skeleton.names[0] == NAMES["hips"]
    assert find_target(odd[0], NAMES).bone_map == NAMES
    save(load(tmp_path / "b.bvh", bone_map=NAMES), tmp_path / "c.glb", avatar=still)
    convert_file(tmp_path / "b.bvh", tmp_path / "d.glb", avatar=still, names=odd[1])  # the map is that of the motion
    (tmp_path / "map.toml").write_text('[bones]\nhips = "who"')
    with pytest.raises(InputError, match=r"b.bvh': bone map: 'who' is none of their joints"):
        convert_file(tmp_path / "b.bvh", tmp_path / "d.glb", avatar=still, names=odd[1])


def test_a_map_overrides_what_a_vrm_says(still, tmp_path):  # noqa: F811
    rewrite(still, tmp_path / "a.glb", as_vrm1)
    own_rig = load_avatar(tmp_path / "a.glb").rig
    toes = humanoid().index["leftToes"]
    rig = load_avatar(tmp_path / "a.glb", {"leftEye": "", "jaw": f"J_{toes:02}"}).rig
    assert rig.nodes[rig.bones["jaw"]] == own_rig.nodes[own_rig.bones["leftToes"]]
    assert {*own_rig.bones} - {*rig.bones} == {"leftEye", "leftToes"}
    with pytest.raises(InputError, match="takes the joint of hips"):
        load_avatar(tmp_path / "a.glb", {"jaw": "J_00"})


def test_the_shape_of_an_avatar_is_told_once(still, tmp_path):  # noqa: F811
    rewrite(still, tmp_path / "a.glb", as_nameless)
    with pytest.warns(CospeechWarning, match="fingers, eyes, jaw were not found") as notes:
        save(gesturing(3), tmp_path / "b.glb", avatar=tmp_path / "a.glb")
    assert len(notes) == 1
    with pytest.warns(CospeechWarning, match="tree was used; eyes, jaw were not found"):
        avatar = load_avatar(tmp_path / "a.glb", {name: NAMES[name] for name in NAMES if "leftIndex" in name})
    assert {"hips", "head", "leftIndexProximal"} <= {*avatar.rig.bones}


def test_hips_that_are_not_above_the_legs_are_refused(odd):
    with pytest.raises(InputError, match=r"is not below hips = 'limb 0 1'"):
        load_avatar(odd[0], {**NAMES, "hips": "limb 0 1"})


def test_a_clip_without_a_surface_is_no_avatar(tmp_path):
    save(gesturing(3), tmp_path / "clip.vrma")
    with pytest.raises(InputError, match="has no surface"):
        save(gesturing(3), tmp_path / "a.glb", avatar=tmp_path / "clip.vrma")
    save(gesturing(3), tmp_path / "a.bvh")
    with pytest.raises(InputError, match="has no surface"):
        convert_file(tmp_path / "a.bvh", tmp_path / "a.glb", avatar=tmp_path / "clip.vrma")
    assert not (tmp_path / "a.glb").exists()


def test_a_map_reaches_the_avatar_of_a_stream(odd, cli):
    avatar, names = odd
    command = ["stream", "-i", str(example()[0]), "--unpaced", "--fps", "10", "--parts", "body", "--avatar", str(avatar)]
    to = ["--to", "vmc://127.0.0.1:39539"]
    code, _, err = cli(*command, *to)
    assert code == 2
    assert "cannot find" in err
    code, _, err = cli(*command, *to, "--map", str(names))
    sent_count, dropped_count = map(int, re.search(r"(\d+) sent, (\d+) dropped", err).groups())
    assert (code, sent_count + dropped_count) == (0, 191)
    assert sent_count > 0, "a busy machine may drop some"
    code, _, err = cli(*command[:-2], *to, "--map", str(names))
    assert code == 2
    assert "--map without --avatar" in err


@pytest.fixture
def two_clips(still, tmp_path):  # noqa: F811
    """A character with a short and a long clip."""
    save(gesturing(5), tmp_path / "two.glb", avatar=still)

    def double(document: dict) -> None:
        (short,) = document["animations"]
        short["name"] = "short"
        channels = [c for c in short["channels"] if c["target"]["path"] == "rotation"]
        document["animations"].append({"name": "turn", "channels": channels, "samplers": short["samplers"]})

    rewrite(tmp_path / "two.glb", tmp_path / "two.glb", double)
    return tmp_path / "two.glb"


def test_a_clip_is_chosen_by_name_or_number(two_clips, tmp_path):
    with pytest.warns(CospeechWarning, match=r"holds 2 clips; clip 0, 'short', is taken"):
        convert_file(two_clips, tmp_path / "a.bvh")
    first, second = (load(two_clips, animation=k) for k in (0, 1))
    assert np.ptp(first.root, 0).max() > 0
    assert np.ptp(second.root, 0).max() == 0  # no translation is in it
    for clip in ("turn", "1"):
        assert np.ptp(convert_file(two_clips, tmp_path / "b.bvh", clip=clip).root, 0).max() == 0
    with pytest.raises(InputError, match=r"no clip 'trn' \(did you mean 'turn'"):
        convert_file(two_clips, tmp_path / "b.bvh", clip="trn")
    with pytest.raises(InputError, match=r"no clip 2 \(0 … 1"):
        convert_file(two_clips, tmp_path / "b.bvh", clip="2")
    with pytest.raises(InputError, match=r"no clips to choose from \(.glb .fbx files have"):
        convert_file(tmp_path / "a.bvh", tmp_path / "b.bvh", clip="2")


def test_lost_clips_are_told(two_clips, tmp_path):
    with pytest.warns(CospeechWarning, match="has 2 clips of its own, which the new file does not hold"):
        save(gesturing(3), tmp_path / "a.glb", avatar=two_clips)
    assert len(read_glb(tmp_path / "a.glb").json["animations"]) == 1


@pytest.mark.slow
def test_the_command_line_takes_map_and_clip_and_tells_each_note_once(odd, two_clips, still, tmp_path):  # noqa: F811
    save(gesturing(3), tmp_path / "a.bvh")
    type_command("render a.bvh a.png --avatar odd.glb --map map.toml", tmp_path)
    type_command("convert a.bvh b.glb --avatar odd.glb --map map.toml", tmp_path)
    assert "--map" in type_command("convert a.bvh c.glb --avatar odd.glb", tmp_path, code=2)[1]
    _, err = type_command("convert two.glb d.bvh", tmp_path)
    assert err.count("note: ") == 1
    assert "--clip" in err
    assert type_command("convert two.glb d.bvh --clip turn", tmp_path)[1] == ""
    rewrite(still, tmp_path / "nameless.glb", as_nameless)
    soundfile.write(tmp_path / "talk.wav", 0.1 * np.sin(np.arange(8000) * 0.05), 16000)
    _, err = type_command("generate talk.wav -o t.glb -o t.png --avatar nameless.glb --takes 2 -q", tmp_path)
    assert err.count("note: ") == err.count("fingers, eyes, jaw were not found") == 1
    (tmp_path / "talk2.wav").write_bytes((tmp_path / "talk.wav").read_bytes())
    both = "generate talk.wav talk2.wav -o {name}.glb --avatar nameless.glb --jobs 2 -q"
    _, err = type_command(both, tmp_path)
    assert err.startswith("note: ")
    assert err.count("\n") == 1
