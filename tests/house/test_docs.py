"""Docs cannot drift: what they take from the code is compared with the code, and what they tell to type is typed."""

from __future__ import annotations

import contextlib
import importlib
import inspect
import json
import os
import re
import subprocess
import sys
import threading
import time
import tomllib
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
import soundfile

import cospeech
from cospeech.cli.catalogue import catalogue
from cospeech.cli.demo import EXAMPLE
from cospeech.cli.main import app
from cospeech.export.glb_container import split_glb
from cospeech.export.gltf_build import GltfBuilder
from cospeech.models import MODELS, NETWORKS, find_bundle
from tests.support.command_line import type_command

ROOT = Path(__file__).resolve().parents[2]
DOCS = sorted((ROOT / "docs").rglob("*.md"))
PAGES = [ROOT / "README.md", *DOCS]
FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.S | re.M)


def tool(name: str):
    """A script of tools/ as a module."""
    spec = spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def fences(path: Path, language: str) -> list[str]:
    return [text for kind, text in FENCE.findall(path.read_text("utf-8")) if kind == language]


def commands(path: Path) -> list[str]:
    """Lines of ``sh`` blocks that run cospeech, without comments."""
    lines = [line.split("#")[0].strip() for text in fences(path, "sh") for line in text.splitlines()]
    return [line.removeprefix(".venv/bin/") for line in lines if re.match(r"(\.venv/bin/)?cospeech ", line)]


@pytest.mark.slow
def test_generated_pages_are_up_to_date():
    stale = [
        str(path.relative_to(ROOT)) for path, text in tool("write_docs").pages().items() if path.read_text("utf-8") != text
    ]
    assert stale == [], "run `make docs`"


def test_how_to_cite():
    """The version is ours, and the papers have the titles that the pages of their models give."""
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"\nversion: {cospeech.__version__}\n" in text
    titles = re.findall(r'^    title: "(.*)"$', text, re.M)
    pages = re.sub(r"\s+", " ", " ".join(path.read_text("utf-8") for path in (ROOT / "docs" / "models").glob("*.md")))
    assert len(titles) == 3
    assert [title for title in titles if title not in pages] == []


def test_every_command_has_a_page():
    names = {command.name or command.callback.__name__ for command in app.registered_commands}
    page = (ROOT / "docs" / "cli.md").read_text("utf-8")
    assert names
    assert all(f"## cospeech {name}\n" in page for name in names)


def test_the_reference_has_every_public_name_and_no_ghost():
    """`::: cospeech.Motion` of docs/api.md is read by mkdocstrings; here it is imported."""
    paths = re.findall(r"^::: (\S+)$", (ROOT / "docs" / "api.md").read_text("utf-8"), re.M)
    assert {f"cospeech.{name}" for name in cospeech.__all__} - set(paths) == {"cospeech.__version__"}
    for path in paths:
        module, _, name = path.rpartition(".")
        if not path.startswith("cospeech.training"):  # needs torch; the tests of training import it
            assert inspect.getdoc(getattr(importlib.import_module(module), name)), path


@pytest.mark.parametrize("name", MODELS)
def test_every_model_has_a_page(name):
    assert (ROOT / "docs" / "models" / f"{name.replace('-', '_')}.md").is_file()


@pytest.mark.parametrize("row", catalogue("formats"), ids=lambda row: row["name"])
def test_every_format_has_a_section(row):
    assert f"\n## {row['name'][1:]}\n" in (ROOT / "docs" / "formats.md").read_text("utf-8")


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_links_lead_somewhere(path):
    text = path.read_text("utf-8")
    links = [link for link in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text) if "://" not in link]
    links += re.findall(r'src="([^"]+)"', text)
    assert [link for link in links if not (path.parent / link).exists()] == []


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A folder with what the commands of the docs take as given."""
    place = tmp_path_factory.mktemp("desk")
    samples, rate = soundfile.read(EXAMPLE, dtype="float32")
    soundfile.write(place / "talk.wav", samples[: 2 * rate], rate)
    (place / "talk.srt").write_text("1\n00:00:00,200 --> 00:00:01,600\nhello all of you\n")
    (place / "talk.txt").write_text("hello all of you\n")
    run("generate talk.wav --transcript talk.srt -o talk.bvh -o talk.glb --plan-out plan.json -q", place)
    soundfile.write(place / "longer.wav", samples[: 6 * rate], rate)  # an example of style has 64 frames of a model
    run("generate longer.wav -o clip.bvh -o other.glb --style southpaw -q", place)
    run("convert talk.bvh from_anywhere.bvh --skeleton unreal -q", place)
    for name, of in (("my_rig.bvh", "talk.bvh"), ("my_character.glb", "talk.glb")):
        (place / name).write_bytes((place / of).read_bytes())
    (place / "moods.csv").write_text(fences(ROOT / "docs" / "styles.md", "csv")[0])
    odd_map = fences(ROOT / "docs" / "skeletons.md", "toml")[0]
    (place / "odd.toml").write_text(odd_map)
    theirs = tomllib.loads(odd_map)["bones"]
    odd = re.sub(
        r"(ROOT|JOINT) (\w+)", lambda m: f"{m[1]} {theirs.get(m[2], 'x' + str(m.start()))}", (place / "talk.bvh").read_text()
    )
    (place / "odd.bvh").write_text(odd)
    document, data = split_glb((place / "talk.glb").read_bytes(), "'talk.glb'")
    document.pop("animations")
    for k, node in enumerate(document["nodes"]):
        node["name"] = theirs.get(node["name"], f"x{k}")
    for name in ("odd.glb", "me.glb"):
        with (place / name).open("wb") as file:
            GltfBuilder(document, data).write(file)
    (place / "names.toml").write_text(odd_map)
    write_conversation(place, samples, rate)
    return place


def write_conversation(place: Path, samples: np.ndarray, rate: int) -> None:
    """The tracks of two people who take turns: host.wav and guest.wav, and both in call.wav."""
    tracks = np.zeros((7 * rate, 2), samples.dtype)
    for channel, name in enumerate(("host", "guest")):
        begin = 3 * channel * rate
        tracks[begin : begin + 3 * rate, channel] = samples[begin : begin + 3 * rate]
        soundfile.write(place / f"{name}.wav", tracks[:, channel], rate)
    soundfile.write(place / "call.wav", tracks, rate)


def run(line: str, place: Path) -> None:
    """Type a command; one that plays live has threads and a clock, and gets a process of its own."""
    if "cospeech stream" not in line:
        type_command(line, place)
        return
    clients = [threading.Thread(target=listen, args=(address,)) for address in re.findall(r"--to listen://(\S+)", line)]
    for client in clients:
        client.start()
    subprocess.run(
        [sys.executable, "-m", "cospeech", *line.removeprefix("cospeech ").split()],
        cwd=place, capture_output=True, text=True, check=True, env=os.environ | {"PYTHONIOENCODING": "utf-8"},
    )  # fmt: skip
    for client in clients:
        client.join()


def listen(address: str) -> None:
    """Hear all frames of a stream, as a page would: it fails if nobody got one."""
    from websockets.sync.client import connect

    until = time.monotonic() + 60
    while time.monotonic() < until:
        with contextlib.suppress(ConnectionRefusedError), connect(f"ws://{address}") as messages:
            for _ in messages:
                pass
            return
        time.sleep(0.1)


def needs_weights(text: str) -> None:
    """Skip what plays a trained model whose weights do not ship yet."""
    for name in NETWORKS:
        if re.search(rf"(--model |load\(\")({name})\b", text) and find_bundle(name) is None:
            pytest.skip(f"needs the weights of {name}, which do not ship (tools/build_weights.py)")


LINES = sorted({line for path in PAGES for line in commands(path)})


@pytest.mark.slow
@pytest.mark.parametrize("line", LINES)
def test_commands_of_the_docs_work(desk, line):
    if re.search(r"--avatar (me\.vrm|my_character\.fbx|SKM_Manny\.fbx)", line):
        pytest.skip("needs an avatar of the reader's; the tests of avatars drive some")
    if line == "cospeech demo":
        pytest.skip("`make demo` is this")
    if "listen://" in line:
        pytest.importorskip("websockets")
    needs_weights(line)
    run(line, desk)
    for name in re.findall(r"-o '?([^\s']+)", line):
        if "{name}" in name:
            continue  # the tests of that command know how the speeches are called
        takes = re.search(r"--takes (\d+)", line)
        paths = [desk / name] if not takes else [desk / f"{Path(name).stem}.{k}{Path(name).suffix}" for k in (1, int(takes[1]))]
        assert all(path.stat().st_size > 100 for path in paths)


def test_the_readme_was_read():
    """The commands of the README are found: a change of its layout must not leave them without a test."""
    assert len(LINES) >= 10
    assert any("generate" in line for line in commands(ROOT / "README.md"))


@pytest.mark.slow
@pytest.mark.parametrize("path", [path for path in PAGES if fences(path, "python")], ids=lambda path: path.name)
def test_python_of_the_docs_runs(path, desk, monkeypatch):
    code = "\n".join(fences(path, "python"))
    if "import bpy" in code:
        compile(code, path.name, "exec")
        return  # Blender runs it: tests of export/bvh.py
    needs_weights(code)
    monkeypatch.chdir(desk)
    exec(compile(code, path.name, "exec"), {})


BROWSER = """
const sent = %s;
const bones = {};
const bone = (name) => bones[name] ??= {
  quaternion: { set(...q) { this.now = q; } },
  position: { set(...p) { this.now = p; } },
};
const vrm = {
  meta: { metaVersion: "%s" },
  humanoid: { getNormalizedBoneNode: bone, normalizedRestPose: { hips: { position: [0, 2, 0] } } },
  expressionManager: { setValue() {} },
};
class WebSocket {}
%s
for (const message of sent) socket.onmessage({ data: JSON.stringify(message) });
console.log(JSON.stringify([bones.hips.position.now, bones.hips.quaternion.now]));
"""


def test_the_client_in_javascript_turns_an_avatar_of_vrm_0_that_faces_the_other_way(node):
    (client,) = fences(ROOT / "docs" / "guides" / "live.md", "js")
    start = {"type": "start", "joints": ["hips"], "offsets": [[0, 1, 0]], "face": ["jawOpen"]}
    frame = {"type": "frame", "root": [0.1, 0.9, 0.2], "rotations": [[0.1, 0.2, 0.3, 0.9]], "face": [0]}
    hips = {}
    for version in "01":
        script = BROWSER % (json.dumps([start, frame]), version, client)
        process = subprocess.run([node, "-e", script], capture_output=True, text=True, timeout=60, check=True)
        hips[version] = [pytest.approx(values) for values in json.loads(process.stdout)]
    assert hips["1"] == [[0.2, 1.8, 0.4], [0.1, 0.2, 0.3, 0.9]]  # its hips are twice as high as ours
    assert hips["0"] == [[-0.2, 1.8, -0.4], [-0.1, 0.2, -0.3, 0.9]]  # the same, after a half turn about the vertical


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_docs_name_no_machine(path):
    assert re.findall(r"/(?:home|root|work|Users)/\w+", path.read_text("utf-8")) == []


@pytest.mark.parametrize(("page", "file"), [("add_a_format.md", "toy_format.py"), ("add_a_model.md", "toy_model.py")])
def test_pages_show_whole_files(page, file):
    """They are up to date by the first test of this file, and run in tests/house/test_plugins.py."""
    text = (ROOT / "docs" / page).read_text("utf-8")
    assert (ROOT / "examples" / "plugins" / file).read_text("utf-8") in text
