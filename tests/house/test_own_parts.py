"""Parts of a contributor that break a rule: the error names the part and the rule, and no other part is harmed."""

from __future__ import annotations

import csv
import sys
import zipfile
from types import ModuleType

import numpy as np
import pytest

import cospeech
from cospeech.corpora import CORPORA, Clip, Corpus, Dropped
from cospeech.corpora.prepare import prepare
from cospeech.corpora.reading import read_each
from cospeech.errors import InputError
from cospeech.export import FORMATS, Format, Writer
from cospeech.metrics import METRICS, Sample, Score, load_metric
from cospeech.metrics.interval import mean_score
from cospeech.metrics.metric import metric
from cospeech.models import ENTRIES, ModelEntry


@pytest.fixture
def own(monkeypatch):
    """A module of the contributor's."""
    module = ModuleType("own_parts")
    monkeypatch.setitem(sys.modules, "own_parts", module)
    return module


# metrics ------------------------------------------------------------------------------------------------------------------


def sample() -> Sample:
    return Sample("a", 15.0, positions=np.ones((20, 3, 3)))


def test_a_metric_cannot_change_what_the_next_one_sees():
    def centre(generated, reference, tools):
        positions = generated[0].positions
        positions -= positions[:, :1]
        return Score(0.0)

    with pytest.raises(ValueError, match="read-only"):
        metric("positions", better="lower")(centre)([sample()])


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (1.5, "gives float"),
        (None, "gives nothing"),
        (Score(np.ones(3)), "is ndarray of shape"),
        (Score(1 + 2j), "is complex"),
        (Score(float("nan")), "comes out as nan"),
    ],
    ids=str,
)
def test_what_is_no_score_is_told(value, message):
    with pytest.raises(InputError, match=message):
        metric("positions", better="lower")(lambda generated, reference, tools: value)([sample()])


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"better": "hihger"}, "better='hihger' of a metric"),
        ({"better": "lower", "same": "rate"}, "same='rate' of a metric"),
        ({"better": "lower", "same": ("size",)}, "same="),
    ],
    ids=str,
)
def test_rules_of_the_decorator(keywords, message):
    with pytest.raises(InputError, match=message):
        metric("positions", **keywords)


def test_needs_and_arguments_of_a_metric():
    with pytest.raises(InputError, match="a metric needs 'smell'"):
        metric("smell", better="lower")
    with pytest.raises(InputError, match=r"the metric 'two': .*it takes \(generated, reference, tools\)"):

        @metric("positions", better="lower")
        def two(generated, reference):
            return Score(0.0)


def test_a_mean_says_which_value_is_no_number():
    with pytest.raises(InputError, match="2 of 3 values are no numbers; the first is that of clip 2"):
        mean_score([1.0, np.nan, np.inf])


def test_rows_of_metrics_that_lead_nowhere(own, monkeypatch):
    own.plain = lambda generated, reference, tools: Score(0.0)
    for row, message in (
        ("no_such_module:x", "No module named 'no_such_module'"),
        ("own_parts:x", "own_parts has no 'x'"),
        ("own_parts:plain", "is a function"),
    ):
        monkeypatch.setitem(METRICS, "mine", row)
        with pytest.raises(InputError, match=message):
            load_metric("mine")


# corpora ------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"split": "dev"}, "clip 'a': 'dev' is no split"),
        ({"speaker": None}, "clip 'a': the speaker is None"),
        ({"speaker": 3}, "clip 'a': the speaker is 3"),
    ],
    ids=str,
)
def test_clips_are_checked_where_they_are_made(values, message):
    with pytest.raises(InputError, match=message):
        Clip(**{"name": "a", "speaker": "me", "corpus": "mine", **values})


def test_one_damaged_recording_does_not_end_the_reading():
    def read(name):
        if name == "b":
            return {}["joints"]
        return Clip(name, "me", "mine")

    first, missing, last = read_each("abc", read)
    assert (first.name, last.name) == ("a", "c")
    assert missing == Dropped("b", "KeyError: 'joints'")

    for error in (csv.Error, EOFError, zipfile.BadZipFile):
        (missing,) = read_each("a", lambda name, error=error: (_ for _ in ()).throw(error("x")))
        assert isinstance(missing, Dropped)

    def fail(name):
        return name.joints

    with pytest.raises(AttributeError):
        list(read_each("abc", fail))


@pytest.mark.parametrize(
    ("read", "message"),
    [
        (lambda raw: iter(["one"]), "yields str"),
        (lambda raw: None, "gives NoneType"),
        (None, "cannot be read: own_parts has no 'read'"),
    ],
    ids=["text", "nothing", "no reader"],
)
def test_readers_that_break_the_rules(own, monkeypatch, tmp_path, read, message):
    if read is not None:
        own.read = read
    monkeypatch.setitem(CORPORA, "mine", Corpus("own_parts", "mine", writable=False))
    with pytest.raises(InputError, match=message):
        prepare("mine", tmp_path / "raw", tmp_path / "store", pose="rot6d-humanoid")
    with pytest.raises(InputError, match=r"no pose representation is set for 'mine' .*rot6d-humanoid"):
        prepare("mine", tmp_path / "raw", tmp_path / "store")


# formats and models -------------------------------------------------------------------------------------------------------


class Silent(Writer):
    """It forgets the path that it is given."""

    def _begin(self, temporary):
        pass

    def _write(self, motion):
        pass

    def _finish(self):
        pass


class Half(Writer):
    """It has no end."""

    def _begin(self, temporary):
        pass

    def _write(self, motion):
        pass


@pytest.mark.parametrize(
    ("writer", "message"),
    [
        (Silent, "nothing was written to"),
        (Half, "the Writer of own_parts cannot write .mine files"),
        (object, "cannot write .mine"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_writers_that_break_the_rules(own, monkeypatch, tmp_path, writer, message):
    own.Writer = writer
    monkeypatch.setitem(FORMATS.ours, ".mine", Format("own_parts", "mine", "nothing"))
    motion = cospeech.load("rules").generate(cospeech.Speech(np.zeros(8000, np.float32)))
    with pytest.raises(InputError, match=message):
        motion.save(tmp_path / "a.mine")
    assert not [*tmp_path.iterdir()]


def test_a_reader_of_a_format_that_gives_no_motion(own, monkeypatch, tmp_path):
    own.load = lambda path: np.zeros(3)
    monkeypatch.setitem(FORMATS.ours, ".mine", Format("own_parts", "mine", "nothing", readable=True))
    (tmp_path / "a.mine").write_text("x")
    with pytest.raises(InputError, match=r"own_parts.load gives ndarray"):
        cospeech.Motion.load(tmp_path / "a.mine")


def test_a_model_without_a_network_that_takes_no_mouth_is_told(own, monkeypatch):
    own.Deaf = type("Deaf", (), {})
    monkeypatch.setitem(ENTRIES.ours, "mine", ModelEntry("own_parts:Deaf", "mine", trains=False))
    with pytest.raises(InputError, match=r"'mine' cannot be made: .*its class takes mouth="):
        cospeech.load("mine")


@pytest.mark.parametrize(
    "make",
    [
        lambda: Format("m", None, "x"),
        lambda: Format("m", "x", "x", holds="body"),
        lambda: Format("m", "x", "x", holds=("legs",)),
        lambda: ModelEntry("m:C", None),
        lambda: ModelEntry("m:C", "x", needs="face"),
        lambda: ModelEntry("m:C", "x", needs=("smell",)),
    ],
)
def test_rows_are_checked_where_they_are_made(make):
    with pytest.raises(InputError, match=r"of a (Format|ModelEntry) is"):
        make()
