"""Bundles that are damaged, foreign or hostile: always one clear error, never anything else."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.runtime.bundle import FORMAT, MANIFEST, Bundle, pack_arrays, read_bundle, write_bundle
from cospeech.runtime.flow_bundle import FlowSystem, open_flow
from cospeech.runtime.flow_weights import FlowSizes
from cospeech.runtime.graph_check import check_onnx
from tests.support.runtime_bundles import (
    check_damage,
    check_repaired_damage,
    contents_of,
    random_arrays,
    small_sizes,
    statistics,
    write_small,
)


@cache
def good() -> bytes:
    folder = Path(mkdtemp(prefix="cospeech-test-"))
    return write_small(folder / "good.cospeech").read_bytes()


def contents() -> tuple[dict, dict[str, bytes]]:
    return contents_of(good())


def opened(path: Path, data: bytes) -> FlowSystem:
    path.write_bytes(data)
    return open_flow(read_bundle(path))


def rewritten(path: Path, manifest: dict, members: dict[str, bytes]) -> FlowSystem:
    """Changed as somebody would who repairs the hashes."""
    write_bundle(path, manifest, members)
    return open_flow(read_bundle(path))


def perform(system: FlowSystem) -> None:
    """A few frames, and latents."""
    sizes, rng = system.engine.sizes, np.random.default_rng(0)
    poses, audio = (rng.normal(size=(12, n)).astype(np.float32) for n in (sizes.pose, sizes.audio))
    z = rng.normal(size=(2, 5, sizes.pose)).astype(np.float32)
    system.engine.begin(np.stack([poses[: sizes.history]] * 2)).frames(system.engine.windows(audio), z)
    system.engine.latents(poses, audio, system.engine.style_code(poses)[None])


def test_there_and_back(tmp_path):
    system = opened(tmp_path / "a.cospeech", good())
    assert (system.pose, system.fps, system.audio, system.smooth) == ("expmap-humanoid", 20.0, "mel20-prosody", 1)
    perform(system)
    assert system.card == "# Random weights\n"
    sizes = small_sizes("expmap-humanoid", "mel20-prosody")
    assert system.engine.sizes == sizes
    for name, value in vars(statistics(sizes)).items():
        assert np.array_equal(getattr(system.statistics, name), value)
    bundle = read_bundle(tmp_path / "a.cospeech")
    assert bundle.manifest["model"] == "stylised-flow"
    assert write_small(tmp_path / "b.cospeech").read_bytes() == good()  # the same contents, the same bytes
    assert (tmp_path / "a.cospeech").stat().st_mode & 0o777 == 0o644


def test_damage_is_an_input_error_or_does_not_matter(tmp_path):
    assert check_damage(partial(opened, tmp_path / "x.cospeech"), good()) > 0.8


def test_damage_behind_repaired_hashes(tmp_path):
    """Errors, or a system whose numbers are all finite."""
    assert check_repaired_damage(partial(rewritten, tmp_path / "x.cospeech"), good(), perform, 150) > 30


def zipped(entries: list[tuple[str, bytes]], **options: int) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", **options) as archive:
        for name, data in entries:
            archive.writestr(name, data)
    return out.getvalue()


def entries(**changes: bytes | None) -> list[tuple[str, bytes]]:
    manifest, members = contents()
    found = {MANIFEST: json.dumps(manifest).encode(), **members} | {k: v for k, v in changes.items() if v is not None}
    return [(name, data) for name, data in found.items() if changes.get(name, b"") is not None]


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize(
    ("what", "data"),
    [
        ("empty", lambda: b""),
        ("text", lambda: b"this is not a zip" * 99),
        ("packed", lambda: zipped(entries(), compression=zipfile.ZIP_DEFLATED)),
        ("bomb", lambda: zipped([("card.md", bytes(1 << 20)), *entries()], compression=zipfile.ZIP_DEFLATED)),
        ("twice", lambda: zipped([*entries(), ("card.md", b"another")])),
        ("upwards", lambda: zipped([*entries(), ("../card.md", b"")])),
        ("absolute", lambda: zipped([*entries(), ("/tmp/card.md", b"")])),
        ("folder", lambda: zipped([*entries(), ("a/b.json", b"")])),
        ("program", lambda: zipped([*entries(), ("model.pkl", b"")])),
        ("more", lambda: zipped([*entries(), ("more.onnx", b"")])),
        ("less", lambda: zipped([e for e in entries() if e[0] != "frame.onnx"])),
        ("many", lambda: zipped([*entries(), *((f"m{n}.md", b"") for n in range(40))])),
        ("no manifest", lambda: zipped([e for e in entries() if e[0] != MANIFEST])),
        ("long card", lambda: zipped([e if e[0] != "card.md" else ("card.md", bytes(2 << 20)) for e in entries()])),
        ("swapped", lambda: zipped([*[e for e in entries() if "onnx" not in e[0]], *swapped()])),
    ],
)
def test_foreign_and_hostile_files(tmp_path, what, data):
    with pytest.raises(InputError):
        opened(tmp_path / "x.cospeech", data())


def swapped() -> list[tuple[str, bytes]]:
    graphs = [e for e in entries() if "onnx" in e[0]]
    return [(a[0], b[1]) for a, b in zip(graphs, graphs[1:] + graphs[:1], strict=True)]


def test_a_lie_about_sizes(tmp_path):
    """An entry that claims more than the file has: nothing of that size is ever allocated."""
    data = bytearray(good())
    at = data.rfind(b"PK\x01\x02")
    data[at + 20 : at + 28] = struct.pack("<II", 900_000, 900_000)
    with pytest.raises(InputError):
        opened(tmp_path / "x.cospeech", bytes(data))


def test_names_of_files(tmp_path):
    for path in (tmp_path, tmp_path / "missing.cospeech", "a\0b", "/dev/zero"):
        with pytest.raises(InputError):
            read_bundle(path)


@pytest.mark.parametrize(
    "change",
    [
        {"format": FORMAT + 1}, {"format": "1"}, {"kind": "vae"}, {"kind": None}, {"pose": "expmap-upper"}, {"pose": 3},
        {"audio": "loud"}, {"audio": "mel27"}, {"fps": 0}, {"fps": "20"}, {"fps": 1e9}, {"smooth": -1}, {"smooth": 10**9},
        {"smooth": True}, {"sizes": {}}, {"sizes": None}, {"members": None}, {"members": {"card.md": 1}},
        
        {"controls": ["hand_height"]}, {"controls": "all"}, {"styles": ["ada"]}, {"styles": ["ada", "ada"]},
        {"styles": ["ada", 1]}, {"styles": None}, {"style": "cid"},
    ],
    ids=str,
)  # fmt: skip
def test_manifests(tmp_path, change):
    manifest, members = contents()
    manifest |= change
    with pytest.raises(InputError):
        opened(tmp_path / "x.cospeech", zipped([(MANIFEST, json.dumps(manifest).encode()), *members.items()]))


@pytest.mark.parametrize(
    "change",
    [
        {"hidden": 9}, {"hidden": "8"}, {"hidden": 8.5}, {"hidden": True}, {"hidden": -1}, {"steps": 10**12}, {"layers": 3},
        {"cell": "lstm"}, {"cell": []}, {"history": 5}, {"nu": None}, {"nu": "inf"}, {"int8": False}, {"int8": "yes"},
        {"odd": 1},
        {"heard": 4}, {"feature": 0}, {"style": 0},
    ],
    ids=str,
)  # fmt: skip
def test_sizes_that_do_not_fit(tmp_path, change):
    manifest, members = contents()
    manifest["sizes"] |= change
    with pytest.raises(InputError):
        rewritten(tmp_path / "x.cospeech", manifest, members)


@pytest.mark.parametrize("name", ["weights.safetensors", "statistics.safetensors"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_numbers_that_are_none(tmp_path, name, value):
    manifest, members = contents()
    arrays = Bundle("x", manifest, members).arrays(name)
    for key in ("0.mix", "past.s", "pose_mean", "histories", "audio_std"):
        if key in arrays:
            wrong = {**arrays, key: np.where(np.arange(arrays[key].size).reshape(arrays[key].shape) == 3, value, arrays[key])}
            wrong[key] = wrong[key].astype(np.float32)
            with pytest.raises(InputError):
                rewritten(tmp_path / "x.cospeech", manifest, {**members, name: pack_arrays(wrong)})


def test_statistics_that_make_no_sense(tmp_path):
    manifest, members = contents()
    arrays = Bundle("x", manifest, members).arrays("statistics.safetensors")
    for wrong in (
        {"pose_std": 0 * arrays["pose_std"]}, {"pose_low": arrays["pose_high"] + 1}, {"histories": arrays["histories"][:0]},
        {"histories": arrays["histories"][:5]}, {"styles": arrays["styles"][:1]},
        {"speaker_mean": arrays["speaker_mean"][:, 1:]},
        {"histories": arrays["histories"][0]}, {"pose_mean": arrays["pose_mean"][1:]}, {"more": arrays["pose_mean"]},
        {"pose_mean": arrays["pose_mean"].astype(float)},
    ):  # fmt: skip
        with pytest.raises(InputError):
            rewritten(tmp_path / "x.cospeech", manifest, {**members, "statistics.safetensors": pack_arrays(arrays | wrong)})


def graph_with(change) -> bytes:
    """The frame's graph, changed through the package onnx."""
    onnx = pytest.importorskip("onnx")
    model = onnx.load_from_string(contents()[1]["frame.onnx"])
    change(onnx, model)
    return model.SerializeToString()


def first_outside(model):
    return next(t for t in model.graph.initializer if t.data_location)


def name_a_file(onnx, model):
    first_outside(model).external_data[0].value = "/etc/passwd"


def name_a_file_late(onnx, model):
    """A second place: the last one counts."""
    first_outside(model).external_data.add(key="location", value="../secret")


def name_a_stretch(onnx, model):
    first_outside(model).external_data.add(key="offset", value="4096")


def sub_graph(onnx, model):
    body = onnx.helper.make_graph([], "body", [], [])
    model.graph.node[3].attribute.append(onnx.helper.make_attribute("then_branch", body))


def tensor_in_a_node(onnx, model):
    tensor = onnx.numpy_helper.from_array(np.zeros(3, np.float32))
    tensor.data_location = 1
    tensor.external_data.add(key="location", value="/etc/passwd")
    model.graph.node[3].attribute.append(onnx.helper.make_attribute("value", tensor))


def other_operator(onnx, model):
    model.graph.node[3].op_type = "Loop"


def other_domain(onnx, model):
    model.graph.node[3].domain = "com.evil"


def function(onnx, model):
    model.functions.add(name="f", domain="x")


def sparse(onnx, model):
    model.graph.sparse_initializer.add()


def wrong_shape(onnx, model):
    first_outside(model).dims[0] += 1


def other_name(onnx, model):
    first_outside(model).name = "nobody"


@pytest.mark.parametrize(
    "change",
    [
        name_a_file, name_a_file_late, name_a_stretch, sub_graph, tensor_in_a_node, other_operator, other_domain, function,
        sparse, wrong_shape, other_name,
    ],
    ids=lambda f: f.__name__,
)  # fmt: skip
def test_graphs_are_looked_into(tmp_path, change):
    manifest, members = contents()
    with pytest.raises(InputError):
        rewritten(tmp_path / "x.cospeech", manifest, {**members, "frame.onnx": graph_with(change)})


def test_what_the_look_sees_is_what_onnx_sees():
    onnx = pytest.importorskip("onnx")
    for name in ("frame", "speech", "past", "style"):
        data = contents()[1][f"{name}.onnx"]
        model = onnx.load_from_string(data)
        names = {t.name: tuple(t.dims) for t in model.graph.initializer if t.data_location}
        assert {key: shape for key, (_, shape) in check_onnx(data).items()} == names
    rng = np.random.default_rng(0)
    for _ in range(300):
        try:
            check_onnx(rng.bytes(int(rng.integers(1, 60))))
        except InputError:
            continue


def test_what_cannot_be_written(tmp_path):
    for name in ("model.pkl", "../a.md", "A.md", "x.tar.gz"):
        with pytest.raises(InputError):
            write_bundle(tmp_path / "x.cospeech", {}, {name: b""})
    assert not list(tmp_path.iterdir())


def test_the_size_that_ships_is_small(tmp_path):
    """3 million parameters: at most 5 MB."""
    from cospeech.runtime.flow_bundle import write_flow

    sizes = replace(
        small_sizes("expmap-humanoid", "mel20-prosody"),
        steps=8,
        hidden=128,
        history=5,
        speech_frames=11,
        feature=16,
        channels=32,
    )
    path = tmp_path / "large.cospeech"
    arrays = random_arrays(sizes)
    write_flow(
        path, arrays, sizes, statistics(sizes), pose="expmap-humanoid", fps=20.0, audio="mel20-prosody",
        facts={"styles": ["ada", "ben"], "style": "ben"},
    )  # fmt: skip
    assert sum(value.size for value in arrays.values()) > 2_800_000
    assert path.stat().st_size <= 5_000_000
    assert isinstance(open_flow(read_bundle(path)).engine.sizes, FlowSizes)
