"""Bundles of every kind: there and back; damaged, foreign or hostile ones are one clear error, never anything else."""

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

pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.audio.features.words import subwords
from cospeech.errors import InputError
from cospeech.runtime.bundles import convert_bundle
from cospeech.runtime.bundles.bundle import FORMAT, MANIFEST, Bundle, pack_arrays, read_bundle, write_bundle
from cospeech.runtime.bundles.graph_check import check_onnx
from cospeech.runtime.bundles.spec import VOICE, BundleSpec, half, read_spec
from cospeech.runtime.network import LIMIT
from cospeech.runtime.system import System, open_bundle, open_system, write_flow, write_networks
from tests.support.runtime_bundles import (
    NAMES,
    WORDS,
    chain_statistics,
    check_damage,
    check_repaired_damage,
    contents_of,
    facts_of,
    flow_statistics,
    random_arrays,
    small_chain,
    small_sizes,
    small_windows,
    window_statistics,
    write_small,
    write_small_chain,
    write_small_window,
)

WRITERS = {"flow": write_small, "window": write_small_window, "chain": write_small_chain}
GRAPH = {"flow": "frame", "window": "make", "chain": "live"}
"""The one that is damaged."""
every_kind = pytest.mark.parametrize("kind", WRITERS)
networks = pytest.mark.parametrize("kind", ["window", "chain"])


@cache
def good(kind: str) -> bytes:
    folder = Path(mkdtemp(prefix="cospeech-test-"))
    return WRITERS[kind](folder / "good.cospeech").read_bytes()


def contents(kind: str) -> tuple[dict, dict[str, bytes]]:
    return contents_of(good(kind))


def write_and_open(path: Path, data: bytes) -> System:
    path.write_bytes(data)
    return open_bundle(path)


def write_and_read(path: Path, data: bytes) -> BundleSpec:
    """As `write_and_open`; with the weights."""
    write_and_open(path, data)
    return read_spec(read_bundle(path))


def rewrite(path: Path, manifest: dict, members: dict[str, bytes]) -> BundleSpec:
    """Write a bundle with other members and right hashes, and read it."""
    write_bundle(path, manifest, members)
    open_bundle(path)
    return read_spec(read_bundle(path))


def perform(spec: BundleSpec) -> dict[str, np.ndarray]:
    """Some frames of everything that a bundle can do; checks that they are numbers within bounds."""
    system, rng, outputs = open_system(spec), np.random.default_rng(0), {}
    low, high = system.statistics.bounds
    if (flow := system.flow) is not None:
        poses, audio = (rng.normal(size=(12, n)).astype(np.float32) for n in (flow.sizes.pose, flow.sizes.audio))
        z = rng.normal(size=(2, 5, flow.sizes.pose)).astype(np.float32)
        outputs["poses"] = flow.begin(np.stack([poses[: flow.sizes.history]] * 2)).frames(flow.windows(audio), z)
        flow.latents(poses, audio, flow.style_code(poses)[None])
    for name, network in system.networks.items():
        state = network.begin(2)
        for _ in range(12 if state else 1):
            shapes = {
                key: [{"N": 2, "T": 64}.get(size, size) for size in port] for key, port in network.signature.inputs.items()
            }
            output = network.run(**{key: rng.normal(size=shape) for key, shape in shapes.items()}, **state)
            state = {key: output[f"next.{key}"] for key in state}
            for key, values in ((key, output[key]) for key in network.signature.outputs):
                bounds = (low, high) if key == "poses" else (-LIMIT, LIMIT)
                assert ((values >= bounds[0]) & (values <= bounds[1])).all(), name
                outputs[f"{name}.{key}"] = values
    if system.statistics.words.size:
        assert np.isfinite(system.word_rows(["a", None, "word"])).all()
    return outputs


@every_kind
def test_there_and_back(kind, tmp_path):
    spec = write_and_read(tmp_path / "a.cospeech", good(kind))
    fps = 15.0 if kind == "chain" else 20.0
    assert (spec.pose, spec.fps, spec.audio, spec.smooth) == ("expmap-humanoid", fps, "mel20-prosody", 1)
    assert (spec.speakers, spec.style, spec.card) == (NAMES, "ada", "# Random weights\n")
    assert spec.styles == (*NAMES, *([VOICE] if kind == "chain" else []))
    expected, width = {}, len(spec.statistics.audio_mean)
    if kind == "flow":
        sizes = small_sizes("expmap-humanoid", "mel20-prosody")
        assert spec.flow == sizes
        statistics = flow_statistics(sizes)
    else:
        build, measure = {"window": (small_windows, window_statistics), "chain": (small_chain, chain_statistics)}[kind]
        signatures, expected, _ = build(57, width)
        assert spec.signatures == signatures
        statistics = measure(signatures)
    for name, value in vars(statistics).items():
        assert not value.size or np.array_equal(getattr(spec.statistics, name), value), name
    for name, value in expected.items():
        assert np.abs(spec.weights[name] - value).max() <= 2**-11 * np.abs(value).max()
    assert read_bundle(tmp_path / "a.cospeech").manifest["model"].startswith(("stylised", "mix", "chain"))
    assert WRITERS[kind](tmp_path / "b.cospeech").read_bytes() == good(kind)  # the same contents, the same bytes
    assert (tmp_path / "a.cospeech").stat().st_mode & 0o777 == 0o644
    assert min(values.std() for values in perform(spec).values()) > 0.01


@networks
def test_half_the_size_makes_nearly_the_same(kind, tmp_path):
    small, exact = (
        perform(read_spec(read_bundle(WRITERS[kind](tmp_path / f"{small}.cospeech", small=small)))) for small in (True, False)
    )
    assert (tmp_path / "True.cospeech").stat().st_size < (tmp_path / "False.cospeech").stat().st_size
    for name in exact:
        assert 0 < np.linalg.norm(small[name] - exact[name]) / np.linalg.norm(exact[name]) < 2e-3
    with pytest.raises(InputError, match="finite"):
        half({"w": np.full((2, 2), 7e4, np.float32)})


def test_words_are_means_of_their_subwords_or_rows_of_a_vocabulary(tmp_path):
    system = write_and_open(tmp_path / "a.cospeech", good("chain"))
    rows, table = system.word_rows(["Hello,", None, "hello", ""]), system.statistics.words
    ids = subwords("hello")
    np.testing.assert_allclose(rows[0], table[ids[ids > 0]].mean(0), atol=1e-6)
    assert np.array_equal(rows[0], rows[2])
    assert not rows[[1, 3]].any()
    assert rows.shape == (4, WORDS)
    with_vocabulary = open_bundle(write_small_chain(tmp_path / "v.cospeech", vocabulary=("yes", "no")))
    table = with_vocabulary.statistics.words
    assert np.array_equal(with_vocabulary.word_rows(["No!", "yes", "maybe", None]), table[[2, 1, 0, 0]])
    assert system.word_rows([]).shape == with_vocabulary.word_rows([]).shape == (0, WORDS)


@pytest.mark.parametrize("without", [{"live": False}, {"judges": False}, {"noise": 0}, {"words": 0}], ids=str)
def test_systems_that_lack_something(tmp_path, without):
    system = open_bundle(write_small_chain(tmp_path / "a.cospeech", **without))
    assert ("live" in system.networks, "classify" in system.networks) == ("live" not in without, "judges" not in without)
    assert (VOICE in system.styles) is ("classify" in system.networks)
    assert (system.main_network.signature.width("noise") > 0, system.statistics.words.size > 0) == (
        "noise" not in without, "words" not in without,
    )  # fmt: skip


@every_kind
def test_damage_is_an_input_error_or_does_not_matter(kind, tmp_path):
    assert check_damage(partial(write_and_read, tmp_path / "x.cospeech"), good(kind)) > 0.8


@every_kind
def test_damage_behind_repaired_hashes(kind, tmp_path):
    """Errors, or a system whose numbers are all finite and within bounds."""
    times, least = (150, 30) if kind == "flow" else (200, 60)
    assert check_repaired_damage(partial(rewrite, tmp_path / "x.cospeech"), good(kind), perform, times) > least


# the file --------------------------------------------------------------------------------------------------------------------


def zip_entries(entries: list[tuple[str, bytes]], **options: int) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", **options) as archive:
        for name, data in entries:
            archive.writestr(name, data)
    return out.getvalue()


def entries() -> list[tuple[str, bytes]]:
    manifest, members = contents("flow")
    return [(MANIFEST, json.dumps(manifest).encode()), *members.items()]


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize(
    ("what", "data"),
    [
        ("empty", lambda: b""),
        ("text", lambda: b"this is not a zip" * 99),
        ("packed", lambda: zip_entries(entries(), compression=zipfile.ZIP_DEFLATED)),
        ("bomb", lambda: zip_entries([("card.md", bytes(1 << 20)), *entries()], compression=zipfile.ZIP_DEFLATED)),
        ("twice", lambda: zip_entries([*entries(), ("card.md", b"another")])),
        ("upwards", lambda: zip_entries([*entries(), ("../card.md", b"")])),
        ("absolute", lambda: zip_entries([*entries(), ("/tmp/card.md", b"")])),
        ("folder", lambda: zip_entries([*entries(), ("a/b.json", b"")])),
        ("program", lambda: zip_entries([*entries(), ("model.pkl", b"")])),
        ("more", lambda: zip_entries([*entries(), ("more.onnx", b"")])),
        ("less", lambda: zip_entries([e for e in entries() if e[0] != "frame.onnx"])),
        ("many", lambda: zip_entries([*entries(), *((f"m{n}.md", b"") for n in range(40))])),
        ("no manifest", lambda: zip_entries([e for e in entries() if e[0] != MANIFEST])),
        ("long card", lambda: zip_entries([e if e[0] != "card.md" else ("card.md", bytes(2 << 20)) for e in entries()])),
        ("swapped", lambda: zip_entries([*[e for e in entries() if "onnx" not in e[0]], *swap_graphs()])),
    ],
)
def test_foreign_and_hostile_files(tmp_path, what, data):
    with pytest.raises(InputError):
        write_and_open(tmp_path / "x.cospeech", data())


def swap_graphs() -> list[tuple[str, bytes]]:
    graphs = [e for e in entries() if "onnx" in e[0]]
    return [(a[0], b[1]) for a, b in zip(graphs, graphs[1:] + graphs[:1], strict=True)]


def test_a_lie_about_sizes(tmp_path):
    """An entry that claims more than the file has: nothing of that size is ever allocated."""
    data = bytearray(good("flow"))
    at = data.rfind(b"PK\x01\x02")
    data[at + 20 : at + 28] = struct.pack("<II", 900_000, 900_000)
    with pytest.raises(InputError):
        write_and_open(tmp_path / "x.cospeech", bytes(data))


def test_names_of_files(tmp_path):
    for path in (tmp_path, tmp_path / "missing.cospeech", "a\0b", "/dev/zero"):
        with pytest.raises(InputError):
            read_bundle(path)


def test_what_cannot_be_written(tmp_path):
    for name in ("model.pkl", "../a.md", "A.md", "x.tar.gz"):
        with pytest.raises(InputError):
            write_bundle(tmp_path / "x.cospeech", {}, {name: b""})
    assert not list(tmp_path.iterdir())


# format 1 --------------------------------------------------------------------------------------------------------------------


def older(kind: str) -> tuple[dict, dict[str, bytes]]:
    """The same bundle as it was in format 1: a kind, sizes, other names."""
    manifest, members = contents(kind)
    arrays = Bundle("x", manifest, members).arrays("statistics.safetensors")
    if kind == "window":
        arrays["style_codes"] = np.eye(2, dtype=np.float32)
    back = {new: old for old, new in convert_bundle.NAMES[kind].items()}
    arrays = {back.get(name, name): value for name, value in arrays.items()}
    members |= {"statistics.safetensors": pack_arrays(arrays)}
    graphs = {name for name in members if name.endswith(".onnx")}
    members |= {name: members[name].replace(b"noise", b"nudge") for name in graphs}  # old name
    if kind == "flow":
        sizes = {{new: old for old, new in convert_bundle.SIZES.items()}.get(k, k): v for k, v in manifest["flow"].items()}
    else:
        make = read_spec(Bundle("x", *contents(kind))).signatures["make"]
        sizes = {"pose": make.width("poses"), "window": make.window}
        if kind == "window":
            sizes |= {"audio": make.width("rows"), "styles": make.width("style"), "modes": make.width("noise")}
            sizes |= {"multiple": make.multiple, "reach": make.reach}
        else:
            sizes |= {"audio": make.width("rows") - WORDS, "words": WORDS, "speakers": 2, "noise": make.width("noise")}
            sizes |= {"reach": 2, "look_ahead": 3, "faces": 0, "seeds": 0}
    plain = {name: fact for name, fact in manifest.items() if name not in ("networks", "flow", "style_space")}
    return plain | {"kind": kind, "sizes": sizes}, members


@every_kind
def test_a_bundle_of_format_1_says_how_to_convert_it_and_plays_the_same_after(kind, tmp_path, monkeypatch):
    old = older(kind)
    with monkeypatch.context() as patch:
        patch.setattr("cospeech.runtime.bundles.bundle.FORMAT", 1)
        write_bundle(tmp_path / "old.cospeech", *old)
    with pytest.raises(InputError, match=r"format 1.*`cospeech bundle old\.cospeech -o new\.cospeech` converts it") as error:
        open_bundle(tmp_path / "old.cospeech")
    assert "\n" not in str(error.value)
    convert_bundle.convert_bundle(tmp_path / "old.cospeech", tmp_path / "new.cospeech")
    outputs, expected = (
        perform(write_and_read(tmp_path / "x.cospeech", data))
        for data in ((tmp_path / "new.cospeech").read_bytes(), good(kind))
    )
    assert {name: array.tobytes() for name, array in outputs.items()} == {
        name: array.tobytes() for name, array in expected.items()
    }
    new, old = (read_spec(read_bundle(path)) for path in (tmp_path / "new.cospeech", tmp_path / "x.cospeech"))
    assert (new.signatures, new.flow, new.styles, new.style_space) == (old.signatures, old.flow, old.styles, old.style_space)
    for name, value in vars(new.statistics).items():
        assert np.array_equal(value, getattr(old.statistics, name)), name


@every_kind
def test_what_cannot_be_converted(kind, tmp_path, monkeypatch):
    (tmp_path / "new.cospeech").write_bytes(good(kind))
    with pytest.raises(InputError, match=r"of format 2, which is today's .it need not be converted"):
        convert_bundle.convert_bundle(tmp_path / "new.cospeech", tmp_path / "again.cospeech")
    manifest, members = older(kind)
    monkeypatch.setattr("cospeech.runtime.bundles.bundle.FORMAT", 1)
    for change in ({"kind": "vae"}, {"sizes": {}}, {"sizes": 3}, {"sizes": manifest["sizes"] | {"pose": 9}}):
        write_bundle(tmp_path / "old.cospeech", manifest | change, members)
        with pytest.raises(InputError) as error:
            convert_bundle.convert_bundle(tmp_path / "old.cospeech", tmp_path / "again.cospeech")
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match=r"ends in \.cospeech"):
        convert_bundle.convert_bundle(tmp_path / "old.cospeech", tmp_path / "again.zip")
    assert not (tmp_path / "again.cospeech").exists()


# the manifest ----------------------------------------------------------------------------------------------------------------

FACTS = [
    {"format": FORMAT + 1}, {"format": "2"}, {"pose": "expmap-upper"}, {"pose": 3}, {"audio": "loud"}, {"audio": "mel27"},
    {"fps": 0}, {"fps": "20"}, {"fps": 1e9}, {"smooth": -1}, {"smooth": 10**9}, {"smooth": True}, {"members": None},
    {"members": {"card.md": 1}}, {"controls": ["hand_height"]}, {"controls": "all"}, {"styles": ["ada"]},
    {"styles": ["ada", "ada"]}, {"styles": ["ada", 1]}, {"styles": None}, {"style": "cid"}, {"style_space": "vae"},
    {"style_space": None}, {"style_space": "none", "flow": None}, {"networks": None}, {"networks": {}}, {"flow": {}},
    {"flow": None}, {"flow": "odd"}, {"vocabulary": 3}, {"vocabulary": [1] * 2000}, {"styles": ["ada", "ben", "cleo"]},
    {"styles": ["ada", "voice", "ben"]}, {"styles": ["ada", "ben", "cleo", "voice"]}, {"networks": {"vae": {}}},
]  # fmt: skip


@every_kind
@pytest.mark.parametrize("change", FACTS, ids=lambda change: str(change)[:40])
def test_manifests(kind, change, tmp_path):
    manifest, members = contents(kind)
    with pytest.raises(InputError) as error:
        write_and_open(
            tmp_path / "x.cospeech", zip_entries([(MANIFEST, json.dumps(manifest | change).encode()), *members.items()])
        )
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("kind", "change"),
    [("window", {"vocabulary": ["a"]}), ("chain", {"vocabulary": ["a"]}), ("chain", {"vocabulary": []}),
     ("window", {"style_space": "code"}), ("chain", {"style_space": "code"})],
    ids=str,
)  # fmt: skip
def test_words_and_styles_of_another_network(kind, change, tmp_path):
    manifest, members = contents(kind)
    with pytest.raises(InputError):
        rewrite(tmp_path / "x.cospeech", manifest | change, members)


@pytest.mark.parametrize(
    "change",
    [
        {"hidden": 9}, {"hidden": "8"}, {"hidden": 8.5}, {"hidden": True}, {"hidden": -1}, {"steps": 10**12}, {"layers": 3},
        {"cell": "lstm"}, {"cell": []}, {"history": 5}, {"nu": None}, {"nu": "inf"}, {"int8": False}, {"int8": "yes"},
        {"odd": 1}, {"heard": 4}, {"feature": 0}, {"style": 0},
    ],
    ids=str,
)  # fmt: skip
def test_sizes_of_another_flow(tmp_path, change):
    manifest, members = contents("flow")
    manifest["flow"] |= change
    with pytest.raises(InputError):
        rewrite(tmp_path / "x.cospeech", manifest, members)


def port(part: str, name: str, *shape: object) -> dict:
    return {part: {name: list(shape)}}


SIGNATURES = [
    ("make", change) for change in (
        port("outputs", "poses", "N", "T", 9), port("outputs", "poses", "N", "T", "57"),
        port("outputs", "poses", "N", "T", True),
        port("outputs", "poses", "N", 57), port("outputs", "poses", 2, "T", 57), port("outputs", "more", "N", "T", 3),
        port("inputs", "rows", 1, "T", 5), port("inputs", "rows", 1, "T", 5.5), port("inputs", "rows", "N", "T", 24),
        port("inputs", "rows", 1, "T", 10**9), port("inputs", "style", "N", "T", 3), port("inputs", "noise", "N", "T", 4),
        port("inputs", "noise", "N", "T", 0), port("inputs", "noise", "N", "T", -1), port("inputs", "noise", "N", "Z", 3),
        port("inputs", "words", 1, "T", 3), port("inputs", "face", 1, "T", 53), port("inputs", "seed", 1, "T", 58),
        port("inputs", "rows"), {"inputs": 3}, {"inputs": {"rows": 3}}, {"outputs": {}}, port("state", "state0", "N", 4),
        {"window": 0}, {"window": 10**12}, {"window": None}, {"multiple": 0}, {"multiple": None}, {"reach": -1},
        {"reach": "far"}, {"reach": 10**9}, {"reach": 2.5}, {"odd": 1}, {"look_ahead": 10**9}, {"look_ahead": 2.5},
        {"look_ahead": -3}, {"hop": 0}, {"hop": 10**4}, {"seeds": 4}, {"seeds": True},
    )
]  # fmt: skip
LIVE = [
    ("live", change)
    for change in (
        port("outputs", "poses", "N", 9),
        port("outputs", "poses", "N", "T", 57),
        port("inputs", "rows", 1, 5),
        port("inputs", "style", "N", 3),
        port("inputs", "noise", "N", 3),
        {"window": 16},
        {"look_ahead": None},
        port("state", "state0", 1, 9),
        port("state", "state9", "N", 4),
        port("state", "state0", 1, 1 << 40),
        port("state", "state0", "T", 54),
        port("state", "state0", 1, 2, 3),
        port("state", "rows", 1, 4),
        port("inputs", "face", 1, 53),
    )
] + [
    ("classify", change)
    for change in (port("outputs", "logits", 1, "T", 3), port("inputs", "rows", 1, "T", 9), {"reach": None})
]
CASES = [("window", name, change) for name, change in [*SIGNATURES, ("style", port("outputs", "style", 1, 3)),
                                                       ("style", port("inputs", "poses", 1, "T", 9))]]  # fmt: skip
CASES += [("chain", name, change) for name, change in LIVE]


@pytest.mark.parametrize(("kind", "name", "change"), CASES, ids=lambda value: str(value)[:60])
def test_signatures_of_another_network(tmp_path, kind, name, change):
    manifest, members = contents(kind)
    entry = manifest["networks"][name]
    for key, value in change.items():
        merge = isinstance(value, dict) and value and isinstance(entry.get(key, {}), dict)
        entry[key] = entry.get(key, {}) | value if merge else value
    with pytest.raises(InputError) as error:
        rewrite(tmp_path / "x.cospeech", manifest, members)
    assert "\n" not in str(error.value)


# arrays ----------------------------------------------------------------------------------------------------------------------


@every_kind
@pytest.mark.parametrize("name", ["weights.safetensors", "statistics.safetensors"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_numbers_that_are_none(tmp_path, kind, name, value):
    manifest, members = contents(kind)
    arrays = Bundle("x", manifest, members).arrays(name)
    keys = (
        [*arrays]
        if kind != "flow"
        else [k for k in ("0.mix", "past.s", *arrays) if k in arrays and arrays[k].dtype.kind == "f"][:9]
    )
    for key in keys:
        wrong = arrays[key].copy()
        with np.errstate(over="ignore"):
            wrong.flat[wrong.size // 2] = value
        with pytest.raises(InputError):
            rewrite(tmp_path / "x.cospeech", manifest, {**members, name: pack_arrays({**arrays, key: wrong})})


@every_kind
def test_statistics_that_make_no_sense(kind, tmp_path):
    manifest, members = contents(kind)
    arrays = Bundle("x", manifest, members).arrays("statistics.safetensors")
    cases = [
        {"pose_std": 0 * arrays["pose_std"]}, {"audio_std": -arrays["audio_std"]}, {"pose_low": arrays["pose_high"] + 1},
        {"audio_low": arrays["audio_high"] + 1}, {"pose_mean": arrays["pose_mean"][1:]}, {"more": arrays["pose_mean"]},
        {"pose_mean": arrays["pose_mean"].astype(float)}, {"speaker_mean": arrays["speaker_mean"][:, 1:]},
        {"speaker_mean": arrays["speaker_mean"][:1]},
    ]  # fmt: skip
    for key in {"histories", "style_codes", "model_mean", "style_gain", "live_model_mean", "live_style_gain", "words"} & set(
        arrays
    ):
        value = arrays[key]
        cases += [{key: value[1:]}, {key: value[:, 1:]}, {key: value[0]}]
        cases += [{key: 0 * value}, {key: -value}] if key.endswith("style_gain") else []
    if kind == "flow":
        cases += [{"histories": arrays["histories"][:0]}, {"histories": arrays["histories"][:5]}]
    if "words" in arrays:
        words = arrays["words"].copy()
        words[0, 0] = 1
        cases.append({"words": words})
    for wrong in cases:
        with pytest.raises(InputError):
            rewrite(tmp_path / "x.cospeech", manifest, {**members, "statistics.safetensors": pack_arrays(arrays | wrong)})
    del arrays["speaker_mean"]
    with pytest.raises(InputError):
        rewrite(tmp_path / "x.cospeech", manifest, {**members, "statistics.safetensors": pack_arrays(arrays)})


@every_kind
def test_weights_that_do_not_fit(kind, tmp_path):
    manifest, members = contents(kind)
    weights = Bundle("x", manifest, members).arrays("weights.safetensors")
    key = "0.mix" if kind == "flow" else "make.0"
    first = weights[key]
    for wrong in (
        {key: first[:1]}, {key: first.astype(np.float64)}, {key: first.astype(np.int8)}, {"more": first}, {key: first[None]},
    ):  # fmt: skip
        with pytest.raises(InputError):
            rewrite(tmp_path / "x.cospeech", manifest, {**members, "weights.safetensors": pack_arrays(weights | wrong)})
    del weights[key]
    with pytest.raises(InputError):
        rewrite(tmp_path / "x.cospeech", manifest, {**members, "weights.safetensors": pack_arrays(weights)})


# graphs ----------------------------------------------------------------------------------------------------------------------


@networks
def test_graphs_that_are_missing_swapped_or_more(kind, tmp_path):
    manifest, members = contents(kind)
    graphs = {name: data for name, data in members.items() if name.endswith(".onnx")}
    others = {name: data for name, data in members.items() if name not in graphs}
    names, first = [*graphs], next(iter(graphs))
    cases = [{}, graphs | {"more.onnx": graphs[first]}, graphs | {first: b""}, graphs | {first: graphs[first][:-9]}]
    cases += [{name: data for name, data in graphs.items() if name != absent} for absent in graphs]
    cases += [graphs | {a: graphs[b]} for a in names for b in names if a != b]
    cases.append(dict(zip(names, [*graphs.values()][1:] + [graphs[first]], strict=True)))
    for wrong in cases:
        with pytest.raises(InputError):
            rewrite(tmp_path / "x.cospeech", manifest, others | wrong)


def graph_with(kind: str, change, name: str = "") -> dict[str, bytes]:
    """The members of a bundle, of whose graphs one is changed through the package onnx."""
    onnx, members = pytest.importorskip("onnx"), contents(kind)[1]
    member = f"{name or GRAPH[kind]}.onnx"
    model = onnx.load_from_string(members[member])
    change(onnx, model)
    return {**members, member: model.SerializeToString()}


def first_outside(model):
    return next(t for t in model.graph.initializer if t.data_location)


def name_a_file(onnx, model):
    first_outside(model).external_data[0].value = "/etc/passwd"


def name_a_file_late(onnx, model):
    """Name a file for the weights a second time: the last name counts."""
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


def whole_numbers(onnx, model):
    model.graph.input[0].type.tensor_type.elem_type = onnx.TensorProto.INT64


HARM = [
    name_a_file, name_a_file_late, name_a_stretch, sub_graph, tensor_in_a_node, other_operator, other_domain, function, sparse,
    wrong_shape, other_name, whole_numbers,
]  # fmt: skip


@every_kind
@pytest.mark.parametrize("change", HARM, ids=lambda f: f.__name__)
def test_graphs_are_looked_into(kind, change, tmp_path):
    manifest, _ = contents(kind)
    with pytest.raises(InputError) as error:
        rewrite(tmp_path / "x.cospeech", manifest, graph_with(kind, change))
    assert "\n" not in str(error.value)


def one_pose_for_all(onnx, model):
    """Poses of the right width for one frame alone."""
    last = model.graph.node[-1]
    output, last.output[0] = last.output[0], "before"
    at = onnx.numpy_helper.from_array(np.array([0], np.int64), "first")
    model.graph.initializer.append(at)
    model.graph.node.append(onnx.helper.make_node("Gather", ["before", "first"], [output], axis=1))


def more_than_any_memory(onnx, model):
    """Every frame 10¹² times."""
    scales = next(t for t in model.graph.initializer if list(t.float_data) == [1, 1, 4])
    scales.float_data[2] = 1e12


def another_state(onnx, model):
    """A state that nobody asked for."""
    model.graph.input.append(onnx.helper.make_tensor_value_info("state9", onnx.TensorProto.FLOAT, ["N", 4]))


def one_state_less(onnx, model):
    del model.graph.output[-1]


def a_state_of_no_width(onnx, model):
    """The graph gives the state no fixed width."""
    state = next(value for value in model.graph.input if value.name == "state0")
    state.type.tensor_type.shape.dim[1].dim_param = "W"


def a_state_of_any_memory(onnx, model):
    for value in (*model.graph.input, *model.graph.output):
        if value.name.endswith("state0"):
            value.type.tensor_type.shape.dim[1].dim_value = 1 << 40


def a_state_that_grows(onnx, model):
    """After every frame it is twice as long."""
    maker = next(node for node in model.graph.node if "next.state0" in node.output)
    at = list(maker.output).index("next.state0")
    maker.output[at] = "before"
    model.graph.node.append(onnx.helper.make_node("Concat", ["before", "before"], ["next.state0"], axis=1))


STATES = [another_state, one_state_less, a_state_of_no_width, a_state_of_any_memory, a_state_that_grows]
OTHERS = [("window", "make", one_pose_for_all), ("window", "make", more_than_any_memory)]
OTHERS += [("chain", "live", harm) for harm in STATES]
OTHERS += [("chain", name, harm) for name in ("make", "classify") for harm in (name_a_file, whole_numbers)]


@pytest.mark.parametrize(("kind", "name", "harm"), OTHERS, ids=lambda value: getattr(value, "__name__", value))
def test_graphs_do_what_their_signatures_say(tmp_path, kind, name, harm):
    manifest, _ = contents(kind)
    with pytest.raises(InputError) as error:
        rewrite(tmp_path / "x.cospeech", manifest, graph_with(kind, harm, name))
    assert "\n" not in str(error.value)


def divide_by_nothing(onnx, model):
    """Not a number wherever it is 0, infinite elsewhere, in every output and all that is remembered."""
    model.graph.initializer.append(onnx.numpy_helper.from_array(np.zeros(1, np.float32), "nothing"))
    for value in model.graph.output:
        node = next(node for node in model.graph.node if value.name in node.output)
        node.output[list(node.output).index(value.name)] = f"{value.name}.before"
        model.graph.node.append(onnx.helper.make_node("Div", [f"{value.name}.before", "nothing"], [value.name]))


@pytest.mark.parametrize(
    ("kind", "name"), [("window", "make"), ("window", "style"), ("chain", "make"), ("chain", "live"), ("chain", "classify")]
)
def test_what_is_no_number_never_comes_out(tmp_path, kind, name):
    perform(rewrite(tmp_path / "x.cospeech", contents(kind)[0], graph_with(kind, divide_by_nothing, name)))


def test_what_the_look_sees_is_what_onnx_sees():
    onnx = pytest.importorskip("onnx")
    for kind in WRITERS:
        for name, data in contents(kind)[1].items():
            if name.endswith(".onnx"):
                model = onnx.load_from_string(data)
                names = {t.name: tuple(t.dims) for t in model.graph.initializer if t.data_location}
                assert {key: shape for key, (_, shape) in check_onnx(data).items()} == names
    rng = np.random.default_rng(0)
    for _ in range(300):
        try:
            check_onnx(rng.bytes(int(rng.integers(1, 60))))
        except InputError:
            continue


# writing ---------------------------------------------------------------------------------------------------------------------


@networks
def test_what_does_not_fit_is_not_written(kind, tmp_path):
    build, measure = {"window": (small_windows, window_statistics), "chain": (small_chain, chain_statistics)}[kind]
    signatures, weights, graphs = build(57, 24)
    space = {"window": "one-hot", "chain": "speaker-emotion"}[kind]
    facts = facts_of("it") | {"style_space": space}
    facts["styles"] += [VOICE] if kind == "chain" else []
    statistics = measure(signatures)
    not_finite = {**weights, "make.0": weights["make.0"] * np.float32(np.nan)}
    for some, changes in ((weights, {"styles": ["ada"]}), (not_finite, {}), ({**weights, "odd": np.zeros(3, np.float32)}, {})):
        with pytest.raises(InputError):
            write_networks(tmp_path / "x.cospeech", signatures, graphs, some, statistics, facts=facts | changes)
    for width in (1, -1):
        wrong = replace(statistics, pose_low=statistics.pose_low[width:])
        with pytest.raises(InputError):
            write_networks(tmp_path / "x.cospeech", signatures, graphs, weights, wrong, facts=facts)
    assert not list(tmp_path.iterdir())
    write_networks(tmp_path / "x.cospeech", signatures, graphs, weights, statistics, facts=facts)


def test_the_size_that_ships_is_small(tmp_path):
    """3 million parameters: at most 5 MB."""
    sizes = replace(
        small_sizes("expmap-humanoid", "mel20-prosody"),
        steps=8,
        hidden=128,
        history=5,
        speech_frames=11,
        feature=16,
        channels=32,
    )
    path, arrays = tmp_path / "large.cospeech", random_arrays(sizes)
    write_flow(path, arrays, sizes, flow_statistics(sizes), facts=facts_of("stylised-flow"))
    assert sum(value.size for value in arrays.values()) > 2_800_000
    assert path.stat().st_size <= 5_000_000
    assert open_bundle(path).flow.sizes == sizes
