"""Bundles of chains: there and back; damaged, foreign or hostile ones are one clear error, never anything else."""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.audio.features.words import subwords
from cospeech.errors import InputError
from cospeech.runtime.bundle import Bundle, pack_arrays, read_bundle, write_bundle
from cospeech.runtime.chain_bundle import VOICE, ChainSystem, open_chain, write_chain
from cospeech.runtime.systems import open_system
from tests.support.chain_bundles import NAMES, WORDS, small_chain, small_chain_statistics, write_small_chain
from tests.support.runtime_bundles import check_damage, check_repaired_damage, contents_of, write_small


@cache
def good() -> bytes:
    folder = Path(mkdtemp(prefix="cospeech-test-"))
    return write_small_chain(folder / "good.cospeech").read_bytes()


def contents() -> tuple[dict, dict[str, bytes]]:
    return contents_of(good())


def opened(path: Path, data: bytes) -> ChainSystem:
    path.write_bytes(data)
    return open_chain(read_bundle(path))


def rewritten(path: Path, manifest: dict, members: dict[str, bytes]) -> ChainSystem:
    """Changed as somebody would who repairs the hashes."""
    write_bundle(path, manifest, members)
    return open_chain(read_bundle(path))


def perform(system: ChainSystem) -> np.ndarray:
    """A window of two takes, some frames, and logits; checks that they are numbers within bounds."""
    sizes, rng, engine = system.engine.sizes, np.random.default_rng(0), system.engine
    rows, style, noise = (rng.normal(size=s) for s in ((24, sizes.rows), (2, 24, sizes.style), (2, 24, sizes.noise)))
    made = engine.windows.make(rows, style, noise)
    live = engine.live(2)
    for k in range(12):
        poses = live.frame(rows[k], style[:, k], noise[:, k])
        assert ((poses >= engine.windows.low) & (poses <= engine.windows.high)).all()
    assert made.shape == (2, 24, sizes.pose)
    assert ((made >= engine.windows.low) & (made <= engine.windows.high)).all()
    assert np.isfinite(engine.classify(rows[:, : sizes.audio])).all()
    assert np.isfinite(system.word_rows(["a", None, "word"])).all()
    return made


def test_there_and_back(tmp_path):
    system = opened(tmp_path / "a.cospeech", good())
    assert (system.pose, system.fps, system.audio, system.smooth) == ("expmap-humanoid", 15.0, "mel20-prosody", 1)
    assert (system.styles, system.speakers, system.style) == ((*NAMES, VOICE), NAMES, "ada")
    assert system.card == "# Random weights\n"
    sizes, weights, _ = small_chain(system.engine.sizes.pose, system.engine.sizes.audio)
    assert system.engine.sizes == sizes
    for name, value in vars(small_chain_statistics(sizes)).items():
        assert np.array_equal(getattr(system.statistics, name), value)
    for name, value in weights.items():
        assert np.abs(system.engine.weights[name] - value).max() <= 2**-11 * np.abs(value).max()
    assert write_small_chain(tmp_path / "b.cospeech").read_bytes() == good()  # the same contents, the same bytes
    assert perform(system).std() > 0.05
    assert isinstance(open_system(read_bundle(tmp_path / "a.cospeech")), ChainSystem)


def test_words_are_means_of_their_subwords_or_rows_of_a_vocabulary(tmp_path):
    system = opened(tmp_path / "a.cospeech", good())
    rows, table = system.word_rows(["Hello,", None, "hello", ""]), system.statistics.words
    ids = subwords("hello")
    np.testing.assert_allclose(rows[0], table[ids[ids > 0]].mean(0), atol=1e-6)
    assert np.array_equal(rows[0], rows[2])
    assert not rows[[1, 3]].any()
    assert rows.shape == (4, WORDS)
    listed = open_chain(read_bundle(write_small_chain(tmp_path / "v.cospeech", vocabulary=("yes", "no"))))
    table = listed.statistics.words
    assert np.array_equal(listed.word_rows(["No!", "yes", "maybe", None]), table[[2, 1, 0, 0]])
    assert system.word_rows([]).shape == listed.word_rows([]).shape == (0, WORDS)


@pytest.mark.parametrize("kind", [{"live": False}, {"judges": False}, {"noise": 0}, {"words": 0}], ids=str)
def test_chains_that_lack_something(tmp_path, kind):
    system = open_chain(read_bundle(write_small_chain(tmp_path / "a.cospeech", **kind)))
    assert (system.engine.lives, system.engine.classifies) == ("live" not in kind, "judges" not in kind)
    assert (VOICE in system.styles) is system.engine.classifies


def test_one_door_for_every_kind(tmp_path):
    flow = write_small(tmp_path / "flow.cospeech")
    with pytest.raises(InputError, match="not a chain"):
        open_chain(read_bundle(flow))
    manifest, members = contents()
    for kind in ("vae", None, 3, ["chain"]):
        write_bundle(tmp_path / "x.cospeech", manifest | {"kind": kind}, members)
        with pytest.raises(InputError, match="plays flow, window, chain"):
            open_system(read_bundle(tmp_path / "x.cospeech"))


def test_damage_is_an_input_error_or_does_not_matter(tmp_path):
    assert check_damage(partial(opened, tmp_path / "x.cospeech"), good()) > 0.8


def test_damage_behind_repaired_hashes(tmp_path):
    """Errors, or a system whose numbers are all finite and within bounds."""
    assert check_repaired_damage(partial(rewritten, tmp_path / "x.cospeech"), good(), perform, 200) > 60


@pytest.mark.parametrize(
    "change",
    [
        {"kind": "window"}, {"kind": None}, {"pose": "expmap-upper"}, {"pose": 3}, {"audio": "loud"}, {"audio": "mel27"},
        {"fps": 0}, {"fps": "20"}, {"fps": 1e9}, {"smooth": -1}, {"smooth": 10**9}, {"smooth": True}, {"sizes": {}},
        {"sizes": None}, {"styles": ["ada", "ben"]}, {"styles": ["ada", "ada", "voice"]}, {"styles": ["ada", "voice", "ben"]},
        {"styles": ["ada", 1, "voice"]}, {"styles": None}, {"style": "cid"}, {"styles": ["ada", "ben", "cleo", "voice"]},
        {"vocabulary": ["a"]}, {"vocabulary": 3}, {"vocabulary": [1] * 2000}, {"vocabulary": []},
    ],
    ids=lambda change: str(change)[:40],
)  # fmt: skip
def test_manifests(tmp_path, change):
    manifest, members = contents()
    with pytest.raises(InputError) as told:
        rewritten(tmp_path / "x.cospeech", manifest | change, members)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    "change",
    [
        {"pose": 9}, {"pose": "57"}, {"audio": 5}, {"audio": 5.5}, {"words": 0}, {"words": 4}, {"words": True},
        {"speakers": 3}, {"speakers": 0}, {"speakers": None}, {"noise": 0}, {"noise": -1}, {"noise": 3}, {"window": 0},
        {"window": 10**12}, {"reach": -1}, {"reach": "far"}, {"reach": 10**9}, {"look_ahead": 0}, {"look_ahead": -3},
        {"look_ahead": 10**9}, {"look_ahead": 2.5}, {"odd": 1},
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
    said = arrays["words"].copy()
    said[0, 0] = 1
    for wrong in (
        {"pose_std": 0 * arrays["pose_std"]}, {"audio_std": -arrays["audio_std"]}, {"pose_low": arrays["pose_high"] + 1},
        {"audio_low": arrays["audio_high"] + 1}, {"speaker_mean": arrays["speaker_mean"][:, 1:]},
        {"speaker_mean": arrays["speaker_mean"][:1]}, {"style_gain": 0 * arrays["style_gain"]},
        {"live_style_gain": -arrays["style_gain"]}, {"live_model_mean": arrays["model_mean"][0]}, {"words": said},
        {"words": arrays["words"][1:]}, {"words": arrays["words"][:, 1:]}, {"more": arrays["pose_mean"]},
        {"pose_mean": arrays["pose_mean"].astype(float)},
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
    make, live, judge = (members[f"{name}.onnx"] for name in ("make", "live", "classify"))
    others = {name: data for name, data in members.items() if not name.endswith(".onnx")}
    for graphs in (
        {}, {"live": live, "classify": judge}, {"make": make, "live": live}, {"make": make, "classify": judge},
        {"make": live, "live": make, "classify": judge}, {"make": make, "live": judge, "classify": live},
        {"make": make, "live": live, "classify": judge, "more": live}, {"make": b"", "live": live, "classify": judge},
        {"make": make, "live": live[:-9], "classify": judge},
    ):  # fmt: skip
        with pytest.raises(InputError):
            rewritten(tmp_path / "x.cospeech", manifest, others | {f"{name}.onnx": data for name, data in graphs.items()})


def changed(name: str, change) -> bytes:
    """A graph, changed through the package onnx."""
    onnx = pytest.importorskip("onnx")
    model = onnx.load_from_string(contents()[1][f"{name}.onnx"])
    change(onnx, model)
    return model.SerializeToString()


def loop(onnx, model):
    model.graph.node[3].op_type = "Loop"


def name_a_file(onnx, model):
    next(t for t in model.graph.initializer if t.data_location).external_data[0].value = "/etc/passwd"


def another_state(onnx, model):
    """A state that nobody asked for."""
    model.graph.input.append(onnx.helper.make_tensor_value_info("state9", onnx.TensorProto.FLOAT, ["N", 4]))


def one_state_less(onnx, model):
    del model.graph.output[-1]


def a_state_of_no_width(onnx, model):
    """Announced of any width: nobody can begin with zeros of it."""
    state = next(value for value in model.graph.input if value.name == "state0")
    state.type.tensor_type.shape.dim[1].dim_param = "W"


def a_state_of_any_memory(onnx, model):
    for value in (*model.graph.input, *model.graph.output):
        if value.name.endswith("state0"):
            value.type.tensor_type.shape.dim[1].dim_value = 1 << 40


def a_state_that_grows(onnx, model):
    """After every frame it is twice as long."""
    made = next(node for node in model.graph.node if "next.state0" in node.output)
    at = list(made.output).index("next.state0")
    made.output[at] = "before"
    model.graph.node.append(onnx.helper.make_node("Concat", ["before", "before"], ["next.state0"], axis=1))


def whole_numbers(onnx, model):
    model.graph.input[0].type.tensor_type.elem_type = onnx.TensorProto.INT64


LIVE_HARM = [loop, name_a_file, another_state, one_state_less, a_state_of_no_width, a_state_of_any_memory, a_state_that_grows,
             whole_numbers]  # fmt: skip
CASES = [("live", harm) for harm in LIVE_HARM]
CASES += [(name, harm) for name in ("make", "classify") for harm in (name_a_file, whole_numbers)]


@pytest.mark.parametrize(("name", "harm"), CASES, ids=lambda value: getattr(value, "__name__", value))
def test_graphs_are_looked_into(tmp_path, name, harm):
    manifest, members = contents()
    with pytest.raises(InputError) as told:
        rewritten(tmp_path / "x.cospeech", manifest, {**members, f"{name}.onnx": changed(name, harm)})
    assert "\n" not in str(told.value)


def divide_by_nothing(onnx, model):
    """Not a number wherever it is 0, infinite elsewhere, in the first output and all that is remembered."""
    model.graph.initializer.append(onnx.numpy_helper.from_array(np.zeros(1, np.float32), "nothing"))
    for value in model.graph.output:
        node = next(node for node in model.graph.node if value.name in node.output)
        node.output[list(node.output).index(value.name)] = f"{value.name}.before"
        model.graph.node.append(onnx.helper.make_node("Div", [f"{value.name}.before", "nothing"], [value.name]))


@pytest.mark.parametrize("name", ["make", "live", "classify"])
def test_what_is_no_number_never_comes_out(tmp_path, name):
    manifest, members = contents()
    perform(rewritten(tmp_path / "x.cospeech", manifest, {**members, f"{name}.onnx": changed(name, divide_by_nothing)}))


def test_what_does_not_fit_is_not_written(tmp_path):
    sizes, weights, graphs = small_chain(57, 24)
    options = {"pose": "expmap-humanoid", "fps": 20.0, "audio": "mel20-prosody", "facts": {"styles": ["ada"], "style": "ada"}}
    write = partial(write_chain, tmp_path / "x.cospeech", graphs=graphs, sizes=sizes)
    with pytest.raises(InputError):
        write(weights, statistics=small_chain_statistics(sizes), **options)
    options["facts"]["styles"] = ["ada", "ben", "voice"]
    with pytest.raises(InputError):
        write(
            {**weights, "make.0": weights["make.0"] * np.float32(np.nan)}, statistics=small_chain_statistics(sizes), **options
        )
    assert not list(tmp_path.iterdir())
