"""Characters of others in the studio: their faces move as in a file of `cospeech generate --avatar`, and eyes turn once."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from cospeech.errors import CospeechWarning
from cospeech.export.avatar import Avatar, load_avatar
from cospeech.export.character_files import PACKED
from tests.export.test_avatar import rewrite, still  # noqa: F401  a fixture
from tests.studio.test_page import address, chromium, page, place, seek, talking, wav  # noqa: F401  fixtures
from tests.support.browser import wait_until

pytestmark = pytest.mark.slow
WOMAN, GODETTE = "avatar_mpfb_female_arkit52_viseme15.glb", "Godette_vrm_v4_CC-BY-3.0.vrm"
LOOK = {"inputMaxValue": 90, "outputScale": 90}


@pytest.fixture
def draws() -> bool:
    """Materials of others are drawn."""
    return True


def rename(document: dict, change) -> None:
    for mesh in document["meshes"]:
        if "targetNames" in mesh.get("extras", {}):
            mesh["extras"]["targetNames"] = [change(name) for name in mesh["extras"]["targetNames"]]


def as_short(document: dict) -> None:
    """Names such as eyeBlink_L, with a prefix."""
    rename(document, lambda n: n if n.startswith("viseme") else "Face.M_" + n.replace("Left", "_L").replace("Right", "_R"))


def as_capitals(document: dict) -> None:
    rename(document, lambda name: f"x{name}" if name.startswith("viseme") else name[0].upper() + name[1:])


def as_visemes(document: dict) -> None:
    """Visemes of Oculus, and two lids of ARKit."""
    rename(document, lambda name: name if name.startswith(("viseme", "eyeBlink")) else f"x{name}")


def as_nameless(document: dict) -> None:
    rename(document, lambda name: f"x{len(name)}")


def as_vrm1(document: dict, *, custom: bool = True) -> None:
    """VRM 1.0 that looks by bones; a binary expression, one of two shapes, and ARKit's as custom expressions."""
    names = document["meshes"][0]["extras"]["targetNames"]
    with_shapes = [k for k, mesh in enumerate(document["meshes"]) if mesh["primitives"][0].get("targets")]
    nodes = [k for k, node in enumerate(document["nodes"]) if node.get("mesh") in with_shapes]

    def expression(*shapes: str, weight: float = 1.0) -> dict:
        return {"morphTargetBinds": [{"node": k, "index": names.index(n), "weight": weight} for k in nodes for n in shapes]}

    preset = {
        "aa": expression("jawOpen"), "ou": expression("mouthPucker", weight=0.5), "surprised": expression("browInnerUp"),
        "blink": expression("eyeBlinkLeft", "eyeBlinkRight") | {"isBinary": True}, "lookUp": expression("eyeLookUpLeft"),
    }  # fmt: skip
    arkit = [name for name in names if not name.startswith("viseme")]
    rename(document, lambda name: f"x{names.index(name)}")
    document["extensionsUsed"] = ["VRMC_vrm"]
    document["extensions"] = {"VRMC_vrm": {
        "specVersion": "1.0", "meta": {"name": "t", "authors": ["x"], "licenseUrl": "https://vrm.dev/licenses/1.0/"},
        "humanoid": {"humanBones": bones_of(document)},
        "lookAt": {"type": "bone", "offsetFromHeadBone": [0, 0.06, 0]} | {f"rangeMap{way}": LOOK for way in (
            "HorizontalInner", "HorizontalOuter", "VerticalDown", "VerticalUp")},
        "expressions": {"preset": preset, "custom": {name: expression(name) for name in arkit} if custom else {}},
    }}  # fmt: skip


def as_vrm1_presets(document: dict) -> None:
    as_vrm1(document, custom=False)


BONES: dict[str, dict] = {}


def bones_of(document: dict) -> dict:
    return BONES["of the woman"]


def without(*presets: str):
    """VRM 0.x that lacks some presets."""

    def change(document: dict) -> None:
        master = document["extensions"]["VRM"]["blendShapeMaster"]
        master["blendShapeGroups"] = [each for each in master["blendShapeGroups"] if each["presetName"] not in presets]

    return change


def no_eye_bones(document: dict) -> None:
    """VRM 0.x that looks by shapes: those of the lids will do."""
    humanoid = document["extensions"]["VRM"]["humanoid"]
    humanoid["humanBones"] = [bone for bone in humanoid["humanBones"] if not bone["bone"].endswith("Eye")]
    groups = document["extensions"]["VRM"]["blendShapeMaster"]["blendShapeGroups"]
    blink = next(each for each in groups if each["presetName"] == "blink")
    groups[:] = [each for each in groups if not each["presetName"].startswith("look")]
    groups += [blink | {"presetName": f"look{way}", "name": f"Look{way}"} for way in ("up", "down", "left", "right")]


def same(document: dict) -> None:
    document["asset"]["generator"] = "another program"


def read(path: Path) -> Avatar:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CospeechWarning)
        return load_avatar(path)


@pytest.fixture(scope="module")
def of_others(shared_folder) -> Path:
    folder = shared_folder / "data" / "avatars"
    woman = load_avatar(folder / WOMAN)
    BONES["of the woman"] = {name: {"node": woman.rig.nodes[joint]} for name, joint in woman.rig.bones.items()}
    return folder


def wear(page, path: Path) -> None:  # noqa: F811
    page.set_input_files("#avatar-file", path)
    wait_until(page, f"document.getElementById('avatar-name').textContent === '{path.name}'", 30)


@pytest.mark.parametrize(
    ("source", "change", "alphabet"),
    [
        (WOMAN, same, "shapes of ARKit"),
        (WOMAN, as_short, "shapes of ARKit"),
        (WOMAN, as_capitals, "shapes of ARKit"),
        (WOMAN, as_visemes, "visemes of Oculus"),
        (WOMAN, as_vrm1, "shapes of ARKit"),
        (WOMAN, as_vrm1_presets, "expressions of VRM"),
        (GODETTE, same, "expressions of VRM"),
        (GODETTE, without("blink_l", "blink_r"), "expressions of VRM"),
        (GODETTE, no_eye_bones, "expressions of VRM"),
        (WOMAN, as_nameless, ""),
        ("KayKit_Mage_CC0.glb", same, ""),
    ],
)
def test_a_face_moves_as_in_a_file(page, of_others, tmp_path, source, change, alphabet):  # noqa: F811
    path = tmp_path / f"me{Path(source).suffix}"
    rewrite(of_others / source, path, change)
    if change in (as_vrm1, as_vrm1_presets):
        path = path.rename(tmp_path / "me.vrm")
    wear(page, path)
    line = page.inner_text("#avatar-face")
    assert (line == f"Its face moves by {alphabet}.") is bool(alphabet)
    assert ("cannot be moved" in line) is (not alphabet)
    rig, rng = read(path).face, np.random.default_rng(0)
    faces = np.concatenate([np.zeros((1, 52)), rng.uniform(0, 1, (15, 52)), rng.uniform(0, 0.4, (15, 52)), np.eye(52)])
    expected = rig.weights(faces)
    for k, face in enumerate(faces):
        shapes = page.evaluate("face => cospeechStudio.shapes(face)", face.tolist())
        assert {int(node) for node in shapes} == set(expected)
        for node, weights in expected.items():
            np.testing.assert_allclose(shapes[str(node)], weights[k], atol=1e-6)


@pytest.mark.parametrize(("change", "turns"), [(same, False), (as_visemes, True), (as_vrm1, False), (as_vrm1_presets, True)])
def test_eyes_turn_once(talking, of_others, tmp_path, change, turns):  # noqa: F811
    """Eyes turn by shapes where the shapes turn the eyeballs, else by bones."""
    path = tmp_path / ("me.vrm" if change in (as_vrm1, as_vrm1_presets) else "me.glb")
    rewrite(of_others / WOMAN, path, change)
    wear(talking, path)
    eyes = []
    for at in np.arange(0.4, 4, 0.6):
        seek(talking, at)
        eyes.append(talking.evaluate("cospeechStudio.turn('leftEye')"))
    assert bool(np.ptp(eyes, axis=0).max() > 0.02) is turns
    assert read(path).eyes_by_shapes is not turns


def test_without_a_face_the_mouth_is_shut(talking):  # noqa: F811
    """The weights of such a motion were read as no numbers, and the face vanished."""
    talking.uncheck("#part-face")
    wait_until(talking, "cospeechStudio.settings.parts.length === 2 && cospeechStudio.takes[0].progress === null")
    seek(talking, 1.0)
    wait_until(talking, "cospeechStudio.jawOpen() === 0")


@pytest.mark.parametrize("extension", PACKED)
def test_a_packed_character_is_refused_for_what_it_is(page, still, tmp_path, extension):  # noqa: F811
    extensions = {"extensionsUsed": [extension], "extensionsRequired": [extension]}
    rewrite(still, tmp_path / "me.glb", lambda document: document.update(extensions))
    page.set_input_files("#avatar-file", tmp_path / "me.glb")
    page.locator("#problem:visible").wait_for()
    assert page.inner_text("#problem") == f"me.glb is packed by {extension} (export it without compression)"


def test_scrolling_comes_nearer_to_what_the_pointer_is_on(talking):  # noqa: F811
    box = talking.locator("#view").bounding_box()
    wait_until(talking, "cospeechStudio.onScreen('head') !== null")

    def find(joint: str) -> np.ndarray:
        talking.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        return np.array(talking.evaluate("joint => cospeechStudio.onScreen(joint)", joint))

    before = find("head")
    talking.mouse.move(box["x"] + before[0] * box["width"], box["y"] + before[1] * box["height"])
    size = np.linalg.norm(find("leftEye") - find("rightEye"))
    for _ in range(20):
        talking.mouse.wheel(0, -200)
    wait_until(talking, "cospeechStudio.onScreen('hips')[1] > 1.5")
    assert np.linalg.norm(find("head") - before) < 0.15
    assert np.linalg.norm(find("leftEye") - find("rightEye")) > 4 * size


INSECURE = """for (const name of ["mediaDevices", "clipboard"])
Object.defineProperty(Navigator.prototype, name, { get: () => undefined });"""


def test_a_page_without_https_says_why_there_is_no_microphone_and_shows_the_link(chromium, address):  # noqa: F811
    """As a browser of another computer has it: it gives neither microphone nor clipboard."""
    tab = chromium.new_page()
    tab.add_init_script(INSECURE)
    tab.goto(address)
    wait_until(tab, "document.documentElement.dataset.ready === 'true'")
    tab.locator(".record:visible").first.click()
    tab.locator("#problem:visible").wait_for()
    assert "pages of https or localhost" in tab.inner_text("#problem")
    tab.click("#copy-link")
    wait_until(tab, "document.getElementById('notice').textContent.includes('#model=')")
    assert tab.inner_text("#notice").endswith(tab.url)
    tab.click("#tab-live")
    tab.click("#live-start")
    tab.locator("#live-problem:visible").wait_for()
    assert "pages of https or localhost" in tab.inner_text("#live-problem")
    tab.close()
