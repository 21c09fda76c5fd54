"""The synthetic corpus: varied speakers, words, scores, and the whole way from speech to a store in every layout."""

from __future__ import annotations

import shutil
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import pytest
import soundfile

from cospeech.audio.features import analyse
from cospeech.audio.speech import Speech, Word
from cospeech.cli.demo import EXAMPLE
from cospeech.corpora import CORPORA
from cospeech.corpora.clip import Clip
from cospeech.corpora.prepare import DEFAULT_POSES, prepare
from cospeech.corpora.store import Store
from cospeech.corpora.synthetic import LAYOUTS, perform, synthesise, voices
from cospeech.corpora.synthetic.speakers import choose_speakers, vary_take
from cospeech.corpora.synthetic.speech_splits import SPLIT_SENTENCES, split_recordings
from cospeech.corpora.synthetic.texts import SENTENCES
from cospeech.errors import CospeechWarning, InputError, InternalError
from cospeech.rules import Style

pytestmark = pytest.mark.slow

ENGINES = [name for name in voices.ENGINES if shutil.which(name)]
NEEDS = {"ted": "lmdb", "pats": "h5py"}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Our example cut in two: one half with words, the other without; and a file that is no sound."""
    folder = tmp_path_factory.mktemp("speech")
    samples, rate = soundfile.read(EXAMPLE, dtype="float32")
    soundfile.write(folder / "one.wav", samples[: 9 * rate], rate)
    soundfile.write(folder / "two.wav", samples[9 * rate : 16 * rate], rate)
    (folder / "one.txt").write_text("well I never saw such a huge thing in all my life and you know it")
    (folder / "three.wav").write_bytes(b"RIFF nothing")
    return folder


def test_other_gestures_of_the_same_speech(recordings, tmp_path):
    """The clips of an oracle row have the same names, lengths and sound, and other motion."""
    pytest.importorskip("lmdb")
    stores = []
    for gestures in (0, 1):
        raw = tmp_path / f"raw{gestures}"
        synthesise(raw, "ted", speech=recordings, hours=1 / 90, speakers=2, seed=4, gestures=gestures, tts=False)
        prepare("ted", raw, tmp_path / f"store{gestures}", filters=False)
        stores.append(Store(tmp_path / f"store{gestures}"))
    first, second = stores
    assert [(clip.name, clip.frames) for clip in first.clips] == [(clip.name, clip.frames) for clip in second.clips]
    np.testing.assert_allclose(first.arrays["audio"], second.arrays["audio"], atol=1e-5)
    assert np.abs(first.arrays["pose"] - second.arrays["pose"]).mean() > 0.02


@pytest.mark.parametrize("layout", LAYOUTS)
def test_from_speech_to_a_store(layout, recordings, tmp_path):
    """A minute of each layout is synthesised, prepared and opened."""
    module = CORPORA[layout].module
    if find_spec(module) is None:
        pytest.skip(f"needs the reader of {layout}, which is not there yet")
    if layout in NEEDS:
        pytest.importorskip(NEEDS[layout])
    steps = []
    corpus = synthesise(
        tmp_path / "raw", layout, speech=recordings, hours=1 / 40, speakers=2, seed=4, tts=False,
        progress=lambda seconds, total: steps.append((seconds, total)),
    )  # fmt: skip
    assert corpus.takes == len(steps) >= 2 * 3
    assert 90 <= corpus.seconds < 90 + 2 * LAYOUTS[layout].take
    assert steps[-1] == (corpus.seconds, 90.0)
    assert corpus.speeches < corpus.takes  # several takes per speech
    clips = list(import_module(module).read(tmp_path / "raw"))
    assert all(isinstance(clip, Clip) for clip in clips), [c for c in clips if not isinstance(c, Clip)]
    assert len(clips) == corpus.takes
    report = prepare(layout, tmp_path / "raw", tmp_path / "store", filters=False)
    store = Store(tmp_path / "store")
    assert report.seconds == pytest.approx(corpus.seconds, abs=0.2 * corpus.takes)
    assert store.pose == DEFAULT_POSES[layout]
    assert {clip.split for clip in store.clips} == {"train", "validation", "test"} - (
        {"validation"} if layout == "trinity" else set()
    )
    assert all({"pose", "audio"} <= {*clip.has} for clip in store.clips)
    assert np.isfinite(store.arrays["pose"]).all()
    assert np.isfinite(store.arrays["audio"]).all()
    assert {"never", "huge"} <= set(store.words)
    assert len(store.speakers) == (1 if layout == "trinity" else 2)
    std = store.statistics()[1]
    assert (std > 0).all()
    if layout == "beat":
        assert np.nanmax(store.arrays["semantic"]) >= 0.5
        assert len(set(store.arrays["emotion"].tolist())) >= 2


def test_the_speakers_differ_visibly():
    """Wrist height, speed, use of the right hand, body turn and hip height: no two of eight agree in all, over two takes
    (each speaker plans at random, so two may be alike in one take)."""
    samples, rate = soundfile.read(EXAMPLE, dtype="float32")
    speech, people = Speech(samples[: 12 * rate], rate), choose_speakers(8, 0)
    rows = np.array([[traits(speech, person.style, seed) for person in people] for seed in (1, 2)]).mean(0)
    assert len({person.style.what for person in people}) == 8
    apart = np.abs(rows[:, None] - rows[None]).max(-1)[~np.eye(8, dtype=bool)]
    assert apart.min() > 0.03
    assert np.median(apart) > 0.15


def traits(speech: Speech, style: Style, seed: int) -> list[float]:
    motion = perform(speech, style, emotion="neutral", seed=seed, fps=15.0).motion
    points, index = motion.positions(), motion.skeleton.index
    left, right = (points[:, index[side + "Hand"]] for side in ("left", "right"))
    speed = [np.linalg.norm(np.diff(hand, axis=0), axis=-1).mean() * 15 for hand in (left, right)]
    across = (points[:, index["leftUpperArm"]] - points[:, index["rightUpperArm"]]).mean(0)
    high = ((left + right) / 2 - points[:, index["upperChest"]])[:, 1]
    turn = np.degrees(np.arctan2(across[2], across[0]))
    return [high.mean(), np.std(high), sum(speed), speed[1] / sum(speed), turn / 40, points[:, 0, 1].mean()]


def test_a_cast_of_many_is_mixed_and_depends_on_the_seed():
    many, again, other = choose_speakers(20, 1), choose_speakers(20, 1), choose_speakers(20, 2)
    assert many == again
    assert len({person.name for person in many}) == 20
    assert len({person.style.what for person in many}) == 20
    assert many[15].style != other[15].style
    with pytest.raises(InputError, match="0 speakers"):
        choose_speakers(0, 0)


def test_a_take_has_everything(recordings):
    speech = next(speech for speech in voices.recordings(recordings) if speech.words)
    takes = [perform(speech, choose_speakers(1, 0)[0].style, emotion="anger", seed=seed, fps=25.0) for seed in (1, 1, 2)]
    clip = takes[0]
    assert len(clip.motion) == 225
    assert clip.face.shape == (225, 52)
    assert clip.emotion == "anger"
    assert clip.semantics
    assert all(0 <= s.start < s.end <= 9 and 0 <= s.score <= 1 for s in clip.semantics)
    assert all(a.end <= b.start + 1e-9 for a, b in zip(clip.semantics, clip.semantics[1:], strict=False))
    assert any(s.words and s.score > 0.1 for s in clip.semantics)
    np.testing.assert_array_equal(clip.motion.rotations, takes[1].motion.rotations)
    assert np.abs(clip.motion.rotations - takes[2].motion.rotations).max() > 0.1  # another take of the same speech


def test_recordings_come_with_their_words(recordings):
    speeches_by_name = {speech.name: speech for speech in voices.recordings(recordings)}
    assert sorted(speeches_by_name) == ["one.wav", "two.wav"]
    assert speeches_by_name["two.wav"].words is None
    assert [word.text for word in speeches_by_name["one.wav"].words][:3] == ["well", "I", "never"]


def test_lj_speech_s_table_is_read(recordings, tmp_path):
    shutil.copy(recordings / "two.wav", tmp_path / "LJ001.wav")
    (tmp_path / "metadata.csv").write_text("LJ001|Dr. No|doctor no\n")
    (speech,) = voices.recordings(tmp_path)
    assert [word.text for word in speech.words] == ["doctor", "no"]


def test_pieces_are_cut_and_joined():
    def speech(seconds: float, has_words: bool = True) -> Speech:
        words = tuple(Word(f"w{k}", k + 0.1, k + 0.9) for k in range(int(seconds))) if has_words else None
        return Speech(np.full(round(seconds * 16_000), 0.1, np.float32), 16_000, words)

    pieces = list(voices.pieces_of([speech(25), speech(3), speech(4), speech(2, False)], 10))
    assert all(float(piece.duration) <= 10 for piece in pieces)
    assert [piece.words is None for piece in pieces] == [False] * (len(pieces) - 1) + [True]
    assert sum(len(piece.words or ()) for piece in pieces) >= 25 + 7 - 2 - 4  # words that a cut goes through are left out
    assert all(word.end <= float(piece.duration) + 1e-6 for piece in pieces for word in piece.words or ())


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_speak_with_words(engine):
    voice = next(v for v in voices.find_voices(3) if v.engine == engine)
    speech = voices.say(voice, 4.0, seed=5)
    assert 4 <= float(speech.duration) + 0.6 < 12
    assert len(speech.words) >= 8
    assert all(a.end <= b.start + 1e-6 for a, b in zip(speech.words, speech.words[1:], strict=False))
    assert (analyse(speech).voicing > 0.5).mean() > 0.2


def test_voices_are_varied():
    if "espeak-ng" not in ENGINES:
        pytest.skip("needs espeak-ng")
    choices = [voice for voice in voices.find_voices(0) if voice.engine == "espeak-ng"]
    assert len({(v.name, round(v.speed, 2), v.pitch) for v in choices}) >= 15
    pitches = []
    for timbre in ("f5", "m1"):
        voice = next(v for v in choices if v.name.endswith(timbre))
        pitch = analyse(voices.say(voice, 1.0, 0)).pitch
        pitches.append(np.median(pitch[pitch > 0]))
    assert abs(np.log2(pitches[0] / pitches[1])) > 0.15


def test_an_engine_that_fails_is_reported(monkeypatch):
    process = subprocess.CompletedProcess([], 1, b"", b"no such voice\n")
    monkeypatch.setattr(voices.subprocess, "run", lambda *a, **k: process)
    with pytest.raises(InternalError, match="no such voice"):
        voices.say(voices.Voice("espeak-ng", "en", 1.0), 2.0, 0)


def test_without_speech_and_engines_there_is_nothing_to_say(tmp_path, monkeypatch):
    monkeypatch.setattr(voices.shutil, "which", lambda name: None)
    with pytest.raises(InputError, match="install espeak-ng or flite"):
        synthesise(tmp_path / "raw", "trinity", hours=0.01, tts=False)
    assert list(tmp_path.iterdir()) == []


def test_without_speech_and_engines_the_example_is_performed(tmp_path, monkeypatch):
    monkeypatch.setattr(voices.shutil, "which", lambda name: None)
    with pytest.warns(CospeechWarning, match="everybody performs the example speech"):
        report = synthesise(tmp_path / "raw", "trinity", hours=0.005)
    assert report.takes >= 1


def test_wrong_options_are_answered_in_one_line(recordings, tmp_path):
    full = tmp_path / "full"
    full.mkdir()
    (full / "a").write_text("mine")
    for options, words in [
        ({"layout": "bat"}, "did you mean 'beat'"),
        ({"hours": 0}, "0 hours"),
        ({"hours": float("nan")}, "nan hours"),
        ({"speakers": 0}, "0 speakers"),
        ({"speech": tmp_path / "nowhere"}, "nowhere"),
        ({"raw": full}, "not empty"),
    ]:
        arguments = {"raw": tmp_path / "raw", "layout": "trinity", "speech": recordings, "hours": 0.001, "tts": False} | options
        with pytest.raises(InputError, match=words) as error:
            synthesise(**arguments)
        assert "\n" not in str(error.value)
    assert (full / "a").read_text() == "mine"
    assert not (tmp_path / "raw").exists()


def test_a_writer_that_fails_leaves_nothing(recordings, tmp_path, monkeypatch):
    def fail(clips, raw):
        raw.mkdir()
        next(iter(clips))
        raise InputError("the disk is full")

    monkeypatch.setattr("cospeech.corpora.trinity.read.write", fail)
    with pytest.raises(InputError, match="full"):
        synthesise(tmp_path / "raw", "trinity", speech=recordings, hours=0.001, tts=False)
    assert list(tmp_path.iterdir()) == []


def speeches(count: int, seconds: float, reader: str) -> list[Speech]:
    rng = np.random.default_rng(len(reader))
    samples = (0.05 * rng.normal(size=round(seconds * 16_000))).astype(np.float32)
    return [Speech(samples, name=f"{reader}/{k}.wav") for k in range(count)]


def test_readers_are_told_apart_by_folder(recordings, tmp_path):
    for reader in ("ann", "bob"):
        shutil.copytree(recordings, tmp_path / reader)
    recorded_speeches = list(voices.recordings(tmp_path))
    assert [speech.name for speech in recorded_speeches] == ["ann/one.wav", "ann/two.wav", "bob/one.wav", "bob/two.wav"]
    assert [voices.reader_of(speech) for speech in recorded_speeches] == ["ann", "ann", "bob", "bob"]
    pieces = list(voices.pieces_of([*speeches(3, 2.0, "ann"), *speeches(2, 2.0, "bob")], 30.0))
    assert [voices.reader_of(piece) for piece in pieces] == ["ann", "bob"]


@pytest.fixture
def quick(monkeypatch):
    """Performing is not tested here, so takes are speeches without motion."""
    written_clips: list[Clip] = []

    def still(speech, style, *, emotion, seed, fps):
        return Clip("take", "speaker", "synthetic", speech, emotion=emotion)

    def keep(clips, raw):
        raw.mkdir()
        written_clips.extend(clips)

    monkeypatch.setattr("cospeech.corpora.synthetic.perform", still)
    monkeypatch.setattr(Clip, "duration", property(lambda clip: float(clip.speech.duration)))
    for layout in LAYOUTS:
        monkeypatch.setattr(f"cospeech.corpora.{layout}.read.write", keep)
    return written_clips


@pytest.mark.parametrize("layout", ["beat", "trinity"])
def test_emotions_are_dealt_evenly_and_speakers_have_voices(layout, quick, recordings, tmp_path):
    for reader in ("ann", "bob", "cy"):
        shutil.copytree(recordings, tmp_path / "speech" / reader)
    corpus = synthesise(tmp_path / "raw", layout, speech=tmp_path / "speech", hours=0.2, speakers=3, tts=False, seed=1)
    counts = [corpus.emotions[e] for e in sorted(set(corpus.emotions) - {"neutral"})]
    assert len(counts) == 7
    neutral = corpus.emotions["neutral"] / corpus.takes
    assert 0.1 < neutral < 0.35 if layout == "beat" else 0.35 < neutral < 0.65
    if layout == "beat":
        assert min(counts) >= 0.4 * max(counts)
        readers = {(clip.speaker, voices.reader_of(clip.speech)) for clip in quick}
        assert len(readers) == 3  # one reader each
        assert {split for clip in quick if (split := clip.split)} == {"train", "validation", "test"}


def test_where_the_plan_is_full_the_corpus_is_shorter_and_says_so(quick, recordings, tmp_path, monkeypatch):
    monkeypatch.setattr("cospeech.corpora.synthetic._PLACES", {"train": 1, "validation": 1, "test": 1})
    monkeypatch.setattr("cospeech.corpora.synthetic._NEUTRAL", {"train": 2, "validation": 1, "test": 1})
    with pytest.warns(CospeechWarning, match=r"plan is full: 0\.\d of 1 hours .*--speakers"):
        corpus = synthesise(tmp_path / "raw", speech=recordings, hours=1, speakers=2, tts=False)
    assert corpus.takes == len(quick) == 2 * (7 * 3 + 4)  # one who is full does not stop the other
    assert {clip.speaker for clip in quick} == set(corpus.speakers)
    with pytest.warns(CospeechWarning, match="plan is full"):
        calm = synthesise(tmp_path / "calm", speech=recordings, hours=1, speakers=2, tts=False, neutral=True)
    assert calm.emotions == {"neutral": 2 * 4}


def test_voices_act_in_every_layout_unless_told_not_to(quick, recordings, tmp_path):
    by_split = split_recordings(voices.recordings(recordings)).items()
    given = {
        len(voices.repeat(piece, 5.0 if split == "train" else 8.0).samples)
        for split, own in by_split
        for piece in voices.pieces_of(own, 30.0)
    }
    cases = [("a", "beat", True), ("b", "beat", False), ("c", "trinity", True), ("d", "trinity", False), ("e", "pats", True)]
    for name, layout, acts in cases:
        quick.clear()
        synthesise(tmp_path / name, layout, speech=recordings, hours=0.1, speakers=1, tts=False, act=acts)
        lengths = {len(clip.speech.samples) for clip in quick}
        plain_lengths = lengths & given
        assert bool(plain_lengths) != acts, layout
        assert len(lengths) == (len(quick) if acts else len(plain_lengths)), layout  # no two takes are acted alike


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("readers", [1, 4])
def test_no_speech_of_validation_or_test_is_in_training(layout, readers, quick, monkeypatch, tmp_path, capsys):
    """Each recording has samples that no other has, and engines say sentences; the overlap is printed, and is 0."""
    pytest.importorskip(NEEDS.get(layout, "numpy"))
    number = iter(range(1, 10**6))

    def read(place):
        for reader in range(readers):
            for k in range(2 if reader == 0 else 12):
                values = np.repeat([next(number) for _ in range(20)], 6400) / 2**20  # 0.4 s each: no cut goes through one
                yield Speech(np.float32(values), 16_000, name=f"{reader}/{k}.wav")

    def say(voice, seconds, seed, sentences):
        order = np.random.default_rng(seed).permutation(len(sentences))[:3]
        words = tuple(Word(sentences[k], 2.0 * n, 2.0 * n + 1) for n, k in enumerate(order))
        return Speech(np.zeros(6 * 16_000, np.float32), 16_000, words, name="engine")

    monkeypatch.setattr("cospeech.corpora.synthetic.recordings", read)
    monkeypatch.setattr("cospeech.corpora.synthetic.say", say)
    monkeypatch.setattr("cospeech.corpora.synthetic.find_voices", lambda seed: [voices.Voice("flite", "slt", 1.0)] * 3)
    synthesise(tmp_path / "raw", layout, speech=tmp_path, hours=0.25, speakers=6, act=False)
    by_split = {split: (set(), set()) for split in ("train", "validation", "test")}
    for clip in quick:
        samples, texts = by_split[clip.split]
        samples |= set(np.unique(clip.speech.samples).tolist()) - {0.0}
        texts |= {word.text for word in clip.speech.words or ()}
    assert all(samples and texts for samples, texts in by_split.values())
    for kind, what in enumerate(("recordings", "sentences")):
        for split in ("validation", "test"):
            overlap = by_split[split][kind] & by_split["train"][kind]
            with capsys.disabled():
                sys.stdout.write(f"\n{layout}, {readers} readers, {what} of {split} in training: {len(overlap)}")
            assert not overlap


def test_the_same_words_are_in_one_split_whoever_says_them():
    def speech(name: str, *texts: str) -> Speech:
        words = tuple(Word(text, k + 0.1, k + 0.9) for k, text in enumerate(texts))
        return Speech(np.full(16_000 * len(texts), 0.1, np.float32), 16_000, words, name=name)

    many = [speech(f"ann/{k}.wav", *f"a{k} b{k} c{k}".split()) for k in range(4)]
    again = [speech("bob/0.wav", "a1", "b1", "c1"), speech("cy/0.wav", *"pqrstuvwxy"), speech("dee/0.wav", *"PQRSTUVWXY")]
    by_split = split_recordings([*many, *again])
    texts = {split: [[w.text.lower() for w in s.words] for s in own] for split, own in by_split.items()}
    assert ["a1", "b1", "c1"] in texts["test"]
    assert texts["test"].count(["a1", "b1", "c1"]) == 2
    assert texts["train"].count(list("pqrstu")) == texts["validation"].count(list("vw")) == texts["test"].count(list("xy")) == 2
    assert sum(map(len, texts.values())) == 4 + 1 + 2 * 3
    assert not set(SPLIT_SENTENCES["train"]) & {*SPLIT_SENTENCES["test"], *SPLIT_SENTENCES["validation"]}
    assert sum(map(len, SPLIT_SENTENCES.values())) == len(set(SENTENCES)) >= 400


def test_a_take_has_its_own_tempo_amplitude_and_hand():
    style = choose_speakers(1, 0)[0].style
    takes = [vary_take(style, seed, 1.0) for seed in range(200)]
    assert vary_take(style, 3, 0.0) == style
    assert vary_take(style, 3, 1.0) == takes[3]
    for name, least in (("tempo", 0.05), ("amplitude", 0.1), ("hand", 0.1)):
        values = np.array([getattr(take, name) for take in takes])
        assert values.std() > least
        assert abs(values.mean() - getattr(style, name)) < 0.06
    assert all(0 <= take.hand <= 1 for take in takes)


def test_voices_vary_in_speed_and_pitch_from_speech_to_speech():
    voice = voices.Voice("espeak-ng", "en-us+m1", 1.0, 45)
    variants = {voices.vary_voice(voice, seed) for seed in range(50)}
    assert len(variants) == 50
    assert max(v.pitch for v in variants) - min(v.pitch for v in variants) > 15
    assert 0.85 < min(v.speed for v in variants) < 0.92 < 1.08 < max(v.speed for v in variants) < 1.16
    assert voices.vary_voice(voice, 7) == voices.vary_voice(voice, 7)


def test_a_neutral_corpus_and_one_without_coupling(recordings, tmp_path):
    pytest.importorskip("lmdb")
    settings = []

    def remember(speech, style, **options):
        settings.append((style.coupling, options["emotion"]))
        return perform(speech, style, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cospeech.corpora.synthetic.perform", remember)
        options = {"speech": recordings, "hours": 1 / 90, "speakers": 2, "tts": False}
        corpus = synthesise(tmp_path / "raw", "ted", neutral=True, coupling=0.0, **options)
    assert set(settings) == {(0.0, "neutral")}
    assert corpus.emotions == {"neutral": corpus.takes}
    for wrong in ({"coupling": 1.1}, {"coupling": -0.1}, {"variation": 3.0}):
        with pytest.raises(InputError):
            synthesise(tmp_path / "other", "ted", speech=recordings, tts=False, **wrong)
