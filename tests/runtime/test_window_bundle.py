"""Bundles of window networks: there and back; damaged, foreign or hostile ones are one clear error, never anything else."""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.errors import InputError
from cospeech.runtime.bundle import Bundle, pack_arrays, read_bundle, write_bundle
from cospeech.runtime.flow_bundle import FlowSystem
from cospeech.runtime.systems import open_system
from cospeech.runtime.window_bundle import WindowSystem, halve_weights, open_window, write_window
from tests.support.runtime_bundles import check_damage, check_repaired_damage, contents_of, write_small
from tests.support.window_bundles import small_network, small_statistics, write_small_window


@cache
def good() -> bytes:
    folder = Path(mkdtemp(prefix="cospeech-test-"))
    return write_small_window(folder / "good.cospeech").read_bytes()


def contents() -> tuple[dict, dict[str, bytes]]:
    return contents_of(good())


def opened(path: Path, data: bytes) -> WindowSystem:
    path.write_bytes(data)
    return open_window(read_bundle(path))


def rewritten(path: Path, manifest: dict, members: dict[str, bytes]) -> WindowSystem:
    """Changed as somebody would who repairs the hashes."""
    write_bundle(path, manifest, members)
    return open_window(read_bundle(path))


def perform(system: WindowSystem) -> np.ndarray:
    """A window of two takes, and a style; checks that they are numbers within bounds."""
    sizes, rng, engine = system.engine.sizes, np.random.default_rng(0), system.engine
    rows, poses = (rng.normal(size=(64, n)) for n in (sizes.audio, sizes.pose))
    made = engine.make(rows, *(rng.normal(size=(2, 64, n)) for n in (sizes.styles, sizes.modes)))
    assert made.shape == (2, 64, sizes.pose)
    assert made.dtype == np.float32
    assert ((made >= engine.low) & (made <= engine.high)).all()
    assert np.isfinite(engine.style_of(poses)).all()
    return made


def test_there_and_back(tmp_path):
    system = opened(tmp_path / "a.cospeech", good())
    assert (system.pose, system.fps, system.audio, system.smooth) == ("expmap-humanoid", 20.0, "mel20-prosody", 1)
    assert (system.styles, system.style, system.card) == (("ada", "ben"), "ada", "# Random weights\n")
    sizes, weights, _ = small_network(system.engine.sizes.pose, system.engine.sizes.audio)
    assert system.engine.sizes == sizes
    for name, value in vars(small_statistics(sizes)).items():
        assert np.array_equal(getattr(system.statistics, name), value)
    for name, value in weights.items():
        assert np.abs(system.engine.weights[name] - value).max() <= 2**-11 * np.abs(value).max()
    assert write_small_window(tmp_path / "b.cospeech").read_bytes() == good()  # the same contents, the same bytes
    assert (tmp_path / "a.cospeech").stat().st_mode & 0o777 == 0o644
    assert perform(system).std() > 0.1


def test_half_the_size_makes_nearly_the_same(tmp_path):
    small, exact = (
        open_window(read_bundle(write_small_window(tmp_path / f"{kind}.cospeech", small=kind))) for kind in (True, False)
    )
    assert (tmp_path / "True.cospeech").stat().st_size < 0.8 * (tmp_path / "False.cospeech").stat().st_size
    rounded, wanted = perform(small), perform(exact)
    assert 0 < np.linalg.norm(rounded - wanted) / np.linalg.norm(wanted) < 2e-3
    with pytest.raises(InputError, match="finite"):
        halve_weights({"w": np.full((2, 2), 7e4, np.float32)})


def test_one_door_for_every_kind(tmp_path):
    flow, window = write_small(tmp_path / "flow.cospeech"), write_small_window(tmp_path / "window.cospeech")
    assert isinstance(open_system(read_bundle(flow)), FlowSystem)
    assert isinstance(open_system(read_bundle(window)), WindowSystem)
    with pytest.raises(InputError, match="not a network of windows"):
        open_window(read_bundle(flow))
    manifest, members = contents()
    for kind in ("vae", None, 3, ["flow"]):
        write_bundle(tmp_path / "x.cospeech", manifest | {"kind": kind}, members)
        with pytest.raises(InputError, match="plays flow, window"):
            open_system(read_bundle(tmp_path / "x.cospeech"))


def test_damage_is_an_input_error_or_does_not_matter(tmp_path):
    assert check_damage(partial(opened, tmp_path / "x.cospeech"), good()) > 0.8


def test_damage_behind_repaired_hashes(tmp_path):
    """Errors, or a system whose numbers are all finite and within bounds."""
    assert check_repaired_damage(partial(rewritten, tmp_path / "x.cospeech"), good(), perform, 200) > 60


@pytest.mark.parametrize(
    "change",
    [
        {"kind": "flow"}, {"kind": None}, {"pose": "expmap-upper"}, {"pose": 3}, {"audio": "loud"}, {"audio": "mel27"},
        {"fps": 0}, {"fps": "20"}, {"fps": 1e9}, {"smooth": -1}, {"smooth": 10**9}, {"smooth": True}, {"sizes": {}},
        {"sizes": None}, {"styles": ["ada"]}, {"styles": ["ada", "ada"]}, {"styles": ["ada", 1]}, {"styles": None},
        {"style": "cid"}, {"styles": ["ada", "ben", "cleo"]},
    ],
    ids=str,
)  # fmt: skip
def test_manifests(tmp_path, change):
    manifest, members = contents()
    with pytest.raises(InputError):
        rewritten(tmp_path / "x.cospeech", manifest | change, members)


@pytest.mark.parametrize(
    "change",
    [
        {"pose": 9}, {"pose": "57"}, {"audio": 5}, {"audio": 5.5}, {"styles": 3}, {"styles": 0}, {"styles": True}, {"modes": 4},
        {"modes": 0}, {"modes": -1}, {"multiple": 0}, {"multiple": None}, {"multiple": 3}, {"window": 0}, {"window": 10**12},
        {"reach": -1}, {"reach": "far"}, {"reach": 10**9}, {"reach": 2.5}, {"odd": 1},
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
    for key in arrays:
        wrong = arrays[key].copy()
        with np.errstate(over="ignore"):
            wrong.flat[wrong.size // 2] = value
        with pytest.raises(InputError):
            rewritten(tmp_path / "x.cospeech", manifest, {**members, name: pack_arrays({**arrays, key: wrong})})


def test_statistics_and_weights_that_do_not_fit(tmp_path):
    manifest, members = contents()
    found = Bundle("x", manifest, members)
    arrays, weights = found.arrays("statistics.safetensors"), found.arrays("weights.safetensors")
    for wrong in (
        {"pose_std": 0 * arrays["pose_std"]}, {"audio_std": -arrays["audio_std"]}, {"pose_low": arrays["pose_high"] + 1},
        {"audio_low": arrays["audio_high"] + 1}, {"speaker_mean": arrays["speaker_mean"][:, 1:]},
        {"speaker_mean": arrays["speaker_mean"][:1]},
        {"codes": arrays["codes"][:1]}, {"codes": arrays["codes"][:, :1]}, {"codes": arrays["codes"][0]},
        {"pose_mean": arrays["pose_mean"][1:]}, {"more": arrays["pose_mean"]}, {"pose_mean": arrays["pose_mean"].astype(float)},
    ):  # fmt: skip
        with pytest.raises(InputError):
            rewritten(tmp_path / "x.cospeech", manifest, {**members, "statistics.safetensors": pack_arrays(arrays | wrong)})
    first = weights["make.0"]
    for wrong in (
        {"make.0": first[:1]}, {"make.0": first.astype(np.float64)}, {"make.0": first.astype(np.int8)}, {"more": first},
        {"make.0": first[None]},
    ):  # fmt: skip
        with pytest.raises(InputError):
            rewritten(tmp_path / "x.cospeech", manifest, {**members, "weights.safetensors": pack_arrays(weights | wrong)})
    del weights["make.0"]
    with pytest.raises(InputError):
        rewritten(tmp_path / "x.cospeech", manifest, {**members, "weights.safetensors": pack_arrays(weights)})


def test_graphs_that_are_missing_swapped_or_more(tmp_path):
    manifest, members = contents()
    make, style = members["make.onnx"], members["style.onnx"]
    others = {name: data for name, data in members.items() if not name.endswith(".onnx")}
    for graphs in (
        {}, {"style": style}, {"make": style}, {"make": make}, {"make": style, "style": make}, {"make": make, "style": make},
        {"make": make, "style": style, "more": style}, {"make": b"", "style": style}, {"make": make[:-9], "style": style},
    ):  # fmt: skip
        with pytest.raises(InputError):
            rewritten(tmp_path / "x.cospeech", manifest, others | {f"{name}.onnx": data for name, data in graphs.items()})


def changed(change) -> bytes:
    """The graph ``make``, changed through the package onnx."""
    onnx = pytest.importorskip("onnx")
    model = onnx.load_from_string(contents()[1]["make.onnx"])
    change(onnx, model)
    return model.SerializeToString()


def loop(onnx, model):
    model.graph.node[3].op_type = "Loop"


def name_a_file(onnx, model):
    next(t for t in model.graph.initializer if t.data_location).external_data[0].value = "/etc/passwd"


def one_pose_for_all(onnx, model):
    """Poses of the right width for one frame alone."""
    last = model.graph.node[-1]
    made, last.output[0] = last.output[0], "before"
    at = onnx.numpy_helper.from_array(np.array([0], np.int64), "first")
    model.graph.initializer.append(at)
    model.graph.node.append(onnx.helper.make_node("Gather", ["before", "first"], [made], axis=1))


def divide_by_nothing(onnx, model):
    """Not a number wherever the speech is 0, infinite elsewhere."""
    last = model.graph.node[-1]
    made, last.output[0] = last.output[0], "before"
    model.graph.initializer.append(onnx.numpy_helper.from_array(np.zeros(1, np.float32), "nothing"))
    model.graph.node.append(onnx.helper.make_node("Mul", ["before", "nothing"], ["zero"]))
    model.graph.node.append(onnx.helper.make_node("Div", ["zero", "nothing"], [made]))


def more_than_any_memory(onnx, model):
    """Every frame 10¹² times."""
    scales = next(t for t in model.graph.initializer if t.data_type == onnx.TensorProto.FLOAT and not t.data_location)
    assert list(scales.float_data) == [1, 1, 1, 2]
    scales.float_data[3] = 1e12


@pytest.mark.parametrize("change", [loop, name_a_file, one_pose_for_all, more_than_any_memory], ids=lambda f: f.__name__)
def test_graphs_are_looked_into(tmp_path, change):
    manifest, members = contents()
    with pytest.raises(InputError):
        rewritten(tmp_path / "x.cospeech", manifest, {**members, "make.onnx": changed(change)})


def test_what_is_no_number_never_comes_out(tmp_path):
    manifest, members = contents()
    system = rewritten(tmp_path / "x.cospeech", manifest, {**members, "make.onnx": changed(divide_by_nothing)})
    assert not perform(system).any()


def test_what_does_not_fit_is_not_written(tmp_path):
    sizes, weights, graphs = small_network(57, 26)
    options = {"pose": "expmap-humanoid", "fps": 20.0, "audio": "mel20-prosody", "facts": {"styles": ["ada"], "style": "ada"}}
    with pytest.raises(InputError):
        write_window(tmp_path / "x.cospeech", weights, graphs, sizes, small_statistics(sizes), **options)
    options["facts"]["styles"] = ["ada", "ben"]
    weights["make.0"] = weights["make.0"] * np.float32(np.nan)
    with pytest.raises(InputError):
        write_window(tmp_path / "x.cospeech", weights, graphs, sizes, small_statistics(sizes), **options)
    assert not list(tmp_path.iterdir())
