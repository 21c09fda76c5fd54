"""Errors are in our words: what a library prints or says of a damaged file reaches the user by ``--debug`` alone."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import cospeech
from cospeech import InputError, Speech
from cospeech.models import BUNDLE, SHIPPED
from cospeech.runtime.bundles.bundle import MANIFEST, Bundle, read_bundle, write_bundle

BUNDLES = sorted(SHIPPED.glob(f"*{BUNDLE}"))
LIBRARIES = re.compile(
    r"ONNXRuntimeError|EP Error|codec|Invalid model|INVALID|Error :|libsndfile|Traceback|Exception|<_io", re.I
)
MUTANTS = 60  # of each bundle; a tenth of them opens, a quarter is refused by onnxruntime itself


def with_graph(bundle: Bundle, graph: str, data: bytes, path: Path) -> Path:
    """The bundle with another graph, and the right hash for it."""
    members = {name: data for name, data in bundle.members.items() if name != MANIFEST}
    manifest = {name: value for name, value in bundle.manifest.items() if name not in ("format", "members")}
    write_bundle(path, manifest, members | {graph: data})
    return path


def damage_graph(bundle: Bundle, rng: np.random.Generator, path: Path) -> Path:
    """A bundle with some bytes of one of its graphs changed."""
    graph = str(rng.choice(sorted(name for name in bundle.members if name.endswith(".onnx"))))
    data = bytearray(bundle.members[graph])
    for place in rng.integers(len(data), size=rng.integers(1, 5)):
        data[place] = rng.integers(256)
    return with_graph(bundle, graph, bytes(data), path)


@pytest.mark.slow
@pytest.mark.parametrize("path", BUNDLES, ids=lambda path: path.stem)
def test_a_damaged_graph_is_told_in_our_words_and_nothing_is_printed(tmp_path, capfd, path):
    rng, bundle, refusals = np.random.default_rng(0), read_bundle(path), list[InputError]()
    speech = Speech(0.1 * rng.normal(size=8000).clip(-3, 3).astype(np.float32))
    for _ in range(MUTANTS):
        try:
            cospeech.load(str(damage_graph(bundle, rng, tmp_path / "mine.cospeech"))).generate(speech)
        except InputError as error:
            refusals.append(error)
    assert len(refusals) > MUTANTS // 2
    assert [str(error) for error in refusals if LIBRARIES.search(str(error)) or "'mine.cospeech'" not in str(error)] == []
    causes = [str(error.__cause__.__cause__) for error in refusals if error.__cause__]
    assert any(LIBRARIES.search(cause) for cause in causes)  # what onnxruntime said is kept for --debug
    assert capfd.readouterr() == ("", "")


GRAPHS = [("chain-of-generation", "live", b"rows"), ("chain-of-generation", "make", b"poses"), ("mix-stage", "make", b"rows"),
          ("stylised-flow", "speech", b"windows"), ("stylised-flow", "frame", b"history")]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("name", "graph", "end"), GRAPHS)
def test_a_name_in_a_graph_that_is_no_text_is_told_in_our_words(tmp_path, capfd, name, graph, end):
    bundle = read_bundle(SHIPPED / f"{name}{BUNDLE}")
    data = bundle.members[f"{graph}.onnx"].replace(end, b"\xea" * len(end))
    path = with_graph(bundle, f"{graph}.onnx", data, tmp_path / "mine.cospeech")
    with pytest.raises(InputError, match=r"^'mine\.cospeech': a graph has a name that is no text"):
        cospeech.load(str(path))
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
@pytest.mark.parametrize(
    "content", [b"hello, this is text", b"RIFF\x24\0\0\0WAVEfmt ", b"fLaC" + bytes(60), b"\0\0\0\x20ftypisom" + bytes(100)]
)
def test_a_file_that_is_no_sound_is_told_in_our_words(tmp_path, capfd, content):
    (tmp_path / "talk.wav").write_bytes(content)
    with pytest.raises(InputError, match=r"^'talk\.wav'") as refusal:
        Speech.load(tmp_path / "talk.wav")
    assert LIBRARIES.search(str(refusal.value)) is None
    assert refusal.value.__cause__ is not None
    assert capfd.readouterr() == ("", "")
