"""Several takes of one speech: as many in one pass as the model can play, and the same files as one by one."""

from __future__ import annotations

from pathlib import Path

import pytest
import soundfile

from cospeech.audio.speech import SpeechSource
from cospeech.cli.demo import EXAMPLE
from cospeech.export import npz
from cospeech.generate import generate_files, take_path
from cospeech.models import load
from tests.support.runtime_bundles import write_small

pytestmark = pytest.mark.slow

BUNDLE = "small.cospeech"
PLAYERS = (BUNDLE, "rules")
FILES = ("talk.bvh", "talk.npz")


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with a little speech, longer than files look ahead, and a bundle of random weights; the working folder."""
    monkeypatch.chdir(tmp_path)
    speech, rate = soundfile.read(EXAMPLE, frames=120_000, dtype="float32")
    soundfile.write("talk.wav", speech, rate)
    write_small(Path(BUNDLE))
    return tmp_path


@pytest.fixture
def passes(monkeypatch):
    """A list that grows by one whenever the sound is decoded."""
    names_of_sources, blocks = [], SpeechSource.blocks

    def count(source):
        names_of_sources.append(source.name)
        return blocks(source)

    monkeypatch.setattr(SpeechSource, "blocks", count)
    return names_of_sources


def names() -> list[str]:
    return sorted(path.name for path in Path().iterdir())


@pytest.mark.parametrize("model", PLAYERS)
@pytest.mark.parametrize("skeleton", ["humanoid", "beat"])
def test_takes_are_the_single_runs_of_their_seeds(place, model, skeleton):
    options = {"model": model, "skeleton": skeleton, "fps": 24.0}
    report = generate_files("talk.wav", FILES, seed=7, takes=5, **options)
    assert report.outputs == [f"talk.{take}{suffix}" for take in range(1, 6) for suffix in (".bvh", ".npz")]
    contents = set()
    for take in range(5):
        alone = generate_files("talk.wav", ["alone.bvh", "alone.npz"], seed=7 + take, **options)
        assert (alone.emotion, alone.frames, alone.speech_seconds) == (report.emotion, report.frames, report.speech_seconds)
        for name in FILES:
            content = take_path(name, take + 1, 5).read_bytes()
            assert content == Path("alone").with_suffix(Path(name).suffix).read_bytes()
            contents.add(content)
    assert len(contents) == 10
    assert (report.seed, report.takes) == (7, 5)


def test_sound_is_decoded_once_for_eight_takes(place, passes):
    assert (load(BUNDLE).takes_at_once, load("rules").takes_at_once) == (8, 1)
    generate_files("talk.wav", ["nine.bvh"], model=BUNDLE, seed=3, takes=9)
    assert len(passes) == 2
    assert len({Path(f"nine.{take}.bvh").read_bytes() for take in range(1, 10)}) == 9
    generate_files("talk.wav", ["last.bvh"], model=BUNDLE, seed=11)
    assert Path("nine.9.bvh").read_bytes() == Path("last.bvh").read_bytes()
    passes.clear()
    generate_files("talk.wav", ["two.bvh"], model="rules", takes=2)
    assert len(passes) == 2


@pytest.mark.parametrize("model", PLAYERS)
def test_progress_is_of_all_takes(place, model):
    reports: list[tuple[float, float | None]] = []
    report = generate_files("talk.wav", ["talk.bvh"], model=model, takes=10, progress=lambda *now: reports.append(now))
    whole = 10 * report.speech_seconds
    seconds = [now for now, _ in reports]
    assert [total for _, total in reports] == pytest.approx([whole] * len(reports))
    assert seconds == sorted(seconds)
    assert seconds[0] < whole / 2
    assert whole <= seconds[-1] + 1e-9 < whole + 8.1 / report.fps  # the last frame of a take may end after the speech


@pytest.mark.parametrize("model", PLAYERS)
def test_a_take_that_cannot_be_written_leaves_nothing(place, model, monkeypatch):
    """The third of four, in the middle of the speech; a file of an earlier run stays as it was."""
    writers, begin, write = [], npz.Writer._begin, npz.Writer._write

    def begins(writer, temporary):
        writers.append(writer)
        begin(writer, temporary)

    def fails(writer, motion):
        if writers.index(writer) == 2 and writer.frames:
            raise OSError(28, "No space left on device")
        write(writer, motion)

    monkeypatch.setattr(npz.Writer, "_begin", begins)
    monkeypatch.setattr(npz.Writer, "_write", fails)
    Path("talk.1.bvh").write_text("of an earlier run", encoding="utf-8")
    before = names()
    with pytest.raises(OSError, match="No space left"):
        generate_files("talk.wav", FILES, model=model, takes=4, report="report.json")
    assert names() == before
    assert Path("talk.1.bvh").read_text(encoding="utf-8") == "of an earlier run"
    assert len(writers) == (4 if model == BUNDLE else 3)
