"""Speech file in, motion files out: the call behind ``cospeech generate``, in constant memory.

Sound is decoded in blocks, a model turns them into motion as they come, and every file that was asked for is written at the
same time; so are the takes, as many as the model can play in one pass. Files appear under their names only when all of them
are complete.
"""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from fractions import Fraction
from functools import partial
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from . import __version__
from .audio.emotions import EmotionTrack, read_emotion
from .audio.forced_alignment import align_with_recogniser
from .audio.languages import check_language, with_language
from .audio.level import note_level
from .audio.speech import Speech, SpeechSource, count_frames, open_speech
from .audio.speech_chunks import speech_chunks
from .errors import CospeechWarning, InputError
from .export import FORMATS, check_parts
from .export.checks import File, check_apart, check_avatar, check_files, check_map, check_skeleton, note_idle_gain
from .export.take_files import write_takes, writer_keywords
from .export.target_skeleton import rig_files
from .face.graphemes import note_unread_words
from .files import all_or_none
from .models import DEFAULT, PARTS, GenerationSession, Model, PlannedSession
from .models import load as load_model
from .motion.bone_mapping import load_map
from .motion.motion import Motion
from .motion.skeleton import Skeleton
from .rules.options import FaceGain, GenerationOptions, MotionLike, check_range
from .rules.plan_commands import NO_EDITS, PlanCommands, with_plan
from .runtime.motion_switch import keep_stretches
from .runtime.report import Report, describe_language
from .runtime.styles.style import example_files, read_clip_by_map

__all__ = ["check_request", "generate_files", "generate_motion", "open_live_session", "take_path"]

if TYPE_CHECKING:
    from .export.avatar import Avatar
    from .rules.plan_edits import Plan
    from .runtime.listening import DialogueRole
    from .runtime.live_session import LiveSession

StyleLike = str | PathLike[str] | Motion | Mapping[str | PathLike[str] | Motion, float] | None
TAIL_RANGE = (0.0, 60.0)  # seconds [ours]: more is a slip of the keyboard
Progress = Callable[[float, float | None], None]
"""Called now and then with the seconds done and the seconds in all (None where not known yet)."""


def generate_files(
    audio: File, outputs: File | Sequence[File], *, model: str = DEFAULT, style: StyleLike = None,
    emotion: str | PathLike[str] | EmotionTrack = "auto", speaker: str | None = None, transcript: File | None = None,
    transcribe: bool = False, language: str = "", seed: int = 0, takes: int = 1, temperature: float = 1.0,
    intensity: float = 1.0, parts: Iterable[str] = PARTS, face_gain: FaceGain = 1.0, face: MotionLike = None,
    continue_from: MotionLike = None, plan: File | Plan | None = None, plan_out: File | None = None,
    plan_edits: PlanCommands = NO_EDITS, keep: str = "", keep_from: MotionLike = None, skeleton: File | Skeleton = "humanoid",
    bone_map: File | None = None, fps: float = 30.0, tail: float = 0.0, avatar: File | None = None, report: File | None = None,
    special: Mapping[str, Mapping[str, object]] | None = None, progress: Progress | None = None, loaded: Model | None = None,
    role: DialogueRole | None = None,
) -> Report:  # fmt: skip
    """Generate motion for a sound file, and write it.

    Args:
        audio: the speech; any sound file that `open_speech` reads.
        outputs: files to write, or one; the suffix chooses the format.
        model: registry name, bundle (``mine.cospeech``) or folder of a run.
        style: a style by name; for trained systems also a motion file or a `Motion` whose manner to follow, and mixtures:
            ``"ada:0.7,clip.bvh:0.3"``, or a dict from these to weights. The model's default where not given.
        emotion: one of `cospeech.audio.emotions.EMOTIONS`, or ``auto``, which follows the voice; or one that changes over
            time: an `EmotionTrack`, or the ``.csv`` file of one (`read_emotion_track`).
        speaker: a speaker by name; for the rule-based model speakers are its styles.
        transcript: words of the speech, with times or without; where not given, those of the plan.
        transcribe: recognise the words with faster-whisper (the extra ``asr``) instead.
        language: of the words, a code of `cospeech.audio.languages.LANGUAGES`; found from them where not given.
        seed: of the first take; the next take has the next seed.
        takes: how many; from two on, ``talk.bvh`` becomes ``talk.1.bvh``, ``talk.2.bvh`` …
        temperature: size of the random variation, 0 … 2; with 0, choices are the likeliest ones.
        intensity: size of the motion, 0 … 2.
        parts: of `PARTS`.
        face_gain: how strong the mouth is, 0 … 2, or single channels are: see `cospeech.face.gains.face_gains`.
        face: motion with a face, or a file of one, from which body and hands follow and which is shown; for chains.
        continue_from: motion, or a file of one, at whose last poses it begins; for chains.
        plan: a `Plan` of the gestures, or the file of one; its style, emotion, seed, intensity and temperature are used.
        plan_out: write the plan that was performed to this file.
        plan_edits: changes of the plan before it is played; without a plan, of the plan that the seed gives.
        keep: stretches of ``keep_from`` that the files have instead of new motion: ``0:3.2,5:7``, seconds.
        keep_from: a motion, or a file of one.
        skeleton: of the BVH files: a name, or a rig to take it from (``my_rig.bvh``, ``.glb``, ``.vrm``).
        bone_map: a TOML file that gives the joints of such a rig, or of the avatar, our names, if they are not recognised.
        fps: frames per second; every file has exactly ceil(duration × fps) frames, duration that of speech and tail.
        tail: seconds of silence after the speech, 0 … 60, in which the hands come down.
        avatar: a VRM, GLB or FBX character to show in the place of ours.
        report: write the `Report` as JSON here too.
        special: suffix → keywords for the writer of that format, such as ``{".bvh": {"units": "m"}}``.
        progress: called with (seconds done, seconds in all or None).
        loaded: the model itself, where it is loaded already; ``model`` is its name then.
        role: who this is in a conversation; the voice is that of the role, and it listens while the other one speaks.

    Raises:
        InputError: something given cannot be used; nothing has been written.
    """
    began = time.perf_counter()
    check_range("tail", tail, TAIL_RANGE)
    _check_rivals(style, speaker, transcript, transcribe, language)
    files = [Path(path) for path in ([outputs] if isinstance(outputs, str | PathLike) else outputs)]
    felt, track = read_emotion(emotion)
    options = GenerationOptions(
        style=style or speaker, emotion=felt, seed=seed, intensity=intensity, temperature=temperature, fps=fps, takes=takes,
        parts=tuple(parts), face_gain=face_gain, face=face, continue_from=continue_from)  # fmt: skip
    silence = Fraction(tail).limit_denominator(1000)
    lister = partial(_list_gestures, loaded, model, audio, transcript, transcribe, language, silence)
    options = with_plan(options, plan, plan_edits, audio, transcript, wanted=plan_out is not None, list_gestures=lister)
    old, asked = keep_stretches(keep, keep_from, options.fps), options.style
    options, target, worn = _check_files(options, skeleton, bone_map, avatar, files)
    names = [take_path(path, take, takes) for take in range(1, takes + 1) for path in files]
    given = (transcript, avatar, track, bone_map, face, continue_from, plan, keep_from)
    others = [path for path in (*given, *rig_files(skeleton), *example_files(asked)) if path]
    _check_names(audio, names, others, report, plan, plan_out)
    loaded = _check_parts(loaded or load_model(model), model, options, files)
    with ExitStack() as stack:
        place = stack.enter_context(all_or_none([*names, *(Path(path) for path in (report, plan_out) if path)]))
        source = stack.enter_context(_open_source(role, audio, transcript, language))
        if old:
            old.check_length(source.expected_seconds, tail)
        source.words = with_language(align_with_recogniser(audio), language) if transcribe else source.words
        words = options.plan.speech_words if source.words is None and options.plan is not None else source.words
        note_unread_words(words if "face" in options.parts else None)
        keywords = writer_keywords(files, audio, worn, special or {}, words)
        counts = set[int]()
        for group, performance in _passes(loaded, options):
            staged = [[place(take_path(path, take + 1, takes)) for path in files] for take in group]
            heard = speech_chunks(source, silence)
            made = _play_takes(performance, heard if group.start else note_level(heard, source.name))
            made = role.listen(made, options, group) if role else made
            moving = _with_progress(old.over(made) if old else made, progress, group.start, takes, source, tail)
            counts |= write_takes(moving, staged, target, options.fps, keywords)
        assert source.duration is not None
        seconds, wanted = float(source.duration + silence), count_frames(source.duration + silence, options.fps)
        _check_counts(counts, wanted, model)
        result = Report(
            model=model, speech=source.name, speech_seconds=seconds, frames=wanted, fps=options.fps, seed=options.seed,
            takes=takes, realtime_factor=(time.perf_counter() - began) / (seconds * takes), emotion=performance.emotion,
            played=performance.expression, arousal=performance.arousal, speaker=performance.speaker, version=__version__,
            style=_style_text(asked) or loaded.default_style, style_mixture=performance.style_mixture,
            **describe_language(words, language), outputs=[str(path) for path in names])  # fmt: skip
        if plan_out is not None:
            place(Path(plan_out)).write_text(cast(PlannedSession, performance).plan.to_json(), "utf-8", newline="\n")
        if report:
            place(Path(report)).write_text(result.to_json(), "utf-8", newline="\n")
    return result


def _open_source(role: DialogueRole | None, audio: File, transcript: File | None, language: str) -> SpeechSource:
    """The speech of a file, or of one person in a conversation."""
    return role.open(transcript, language) if role else open_speech(audio, transcript=transcript, language=language)


def _list_gestures(
    loaded: Model | None, model: str, audio: File, transcript: File | None, transcribe: bool, language: str,
    silence: Fraction, options: GenerationOptions,
) -> Plan:  # fmt: skip
    """What is performed with these options, which have an open plan: a plan with all gestures listed.

    Raises:
        InputError: the words are not known yet (``transcribe``), or the model plans no gestures.
    """
    if transcribe:
        hint = "pass --plan plan.json, which --plan-out plan.json writes"
        raise InputError("no gesture can be named before the words are recognised", hint)
    _, session = next(_passes(loaded or load_model(model), replace(options, parts=("body", "hands"))))
    if cast(PlannedSession, session).plan.open:
        raise InputError(f"{model} lists no gestures to remove or to move", "only `rules` does; stretches are for all models")
    with open_speech(audio, transcript=transcript, language=language) as source:
        for _ in _play_takes(session, speech_chunks(source, silence)):
            pass
    return cast(PlannedSession, session).plan


def generate_motion(
    audio: File, *, model: str | Model = DEFAULT, transcript: File | None = None, language: str = "", tail: float = 0.0,
    role: DialogueRole | None = None, emotion: str | PathLike[str] | EmotionTrack = "auto", **options: Any,
) -> Iterator[Motion]:  # fmt: skip
    """The motion that `generate_files` writes, piece by piece.

    Args:
        audio, transcript, language, tail, role, emotion: see there.
        model: a name, a bundle or a run; or a model.
        options: the others that are fields of `cospeech.rules.options.GenerationOptions`; one take.

    Raises:
        InputError: something given cannot be used.
    """
    check_range("tail", tail, TAIL_RANGE)
    loaded = load_model(model) if isinstance(model, str | PathLike) else model
    asked = GenerationOptions.from_keywords({"emotion": read_emotion(emotion)[0], **options})
    group, performance = next(_passes(loaded, asked))
    with _open_source(role, audio, transcript, language) as source:
        made = _play_takes(performance, speech_chunks(source, Fraction(tail).limit_denominator(1000)))
        for takes in role.listen(made, asked, group) if role else made:
            yield takes[0]


def check_request(
    loaded: Model,
    *,
    style: StyleLike = None,
    emotion: str | PathLike[str] | EmotionTrack = "auto",
    speaker: str | None = None,
    **options: Any,
) -> None:
    """Whether a model can do what `generate_files` will ask it for.

    Args:
        loaded: the model.
        style, emotion, speaker: as there.
        options: the others that are fields of `cospeech.rules.options.GenerationOptions`.

    Raises:
        InputError: it cannot.
    """
    _check_rivals(style, speaker, None, False, "")
    asked = GenerationOptions.from_keywords({"style": style or speaker, "emotion": read_emotion(emotion)[0], **options})
    next(_passes(loaded, replace(asked, takes=1)))


def _check_parts(loaded: Model, model: str, options: GenerationOptions, files: Sequence[Path]) -> Model:
    """The model, which moves something in every file.

    Raises:
        InputError: it does not.
    """
    made = [part for part in options.parts if part in loaded.makes]
    if not made:
        raise InputError(f"{model} makes no {' and no '.join(options.parts)}", f"it makes {' and '.join(loaded.makes)}")
    for path in files:
        check_parts(path, made, f"{model} makes")
    return loaded


def take_path(path: File, take: int, takes: int) -> Path:
    """Name of a take: the path itself where there is one take, else with the number before the suffix.

    >>> take_path("talk.bvh", 2, 4).name
    'talk.2.bvh'
    """
    path = Path(path)
    return path if takes == 1 else path.with_name(f"{path.stem}.{take}{path.suffix}")


def open_live_session(
    model: str | Model = DEFAULT,
    *,
    emotion: str | PathLike[str] | EmotionTrack = "auto",
    idle_after: float | None = None,
    angle: float = 0.0,
    **options: Any,
) -> LiveSession:
    """Open a session for a character that is on for hours: it speaks, is interrupted and steered, listens and idles.

    A trained body without legs gets a stance. Its arms keep the limits of their joints. Its hands rest between bouts of
    gestures, if the session has a face and the usual look-ahead. ``look_ahead`` can only make the look-ahead shorter.

    Args:
        model: a name, a bundle or the folder of a run, as for `generate_files`; or a model.
        emotion: see `generate_files`.
        idle_after, angle: see `LiveSession`.
        options: fields of `GenerationOptions`.

    Returns:
        A session: ``push``, ``idle``, ``interrupt`` and ``finish`` it, see `LiveSession`.

    Raises:
        InputError: an option is out of range; a name is unknown, of an option, too; or you give a plan, which only fits one
            speech.
    """
    from .runtime.live_session import LiveSession

    if options.get("plan") is not None:
        raise InputError("a live session plays no plan", "a plan is that of one speech: generate, or model.session(plan=…)")
    opened = load_model(model) if isinstance(model, str | PathLike) else model
    usual = {name: value for name, value in opened.for_files.items() if name in ("stance", "rests", "arm_limits")}
    given = GenerationOptions.from_keywords({**usual, "emotion": read_emotion(emotion)[0], **options})
    if "rests" not in options and not (given.look_ahead is None and "face" in given.parts):
        given = replace(given, rests=False)  # they would wait for longer than anything else does
    return LiveSession(opened, given, idle_after=idle_after, angle=angle)


def _passes(loaded: Model, options: GenerationOptions) -> Iterator[tuple[range, GenerationSession]]:
    """Which takes are played together, from 0 on, and the session that plays them."""
    for first in range(0, options.takes, loaded.takes_at_once):
        group = range(first, min(first + loaded.takes_at_once, options.takes))
        own = replace(options, seed=options.seed + first, takes=len(group), **loaded.for_files)
        yield group, loaded.session(own)


def _play_takes(performance: GenerationSession, chunks: Iterable[Speech]) -> Iterator[list[Motion]]:
    """The takes of one pass from beginning to end: a piece of each at a time."""
    for chunk in chunks:
        yield from performance.push_takes(chunk)
    yield from performance.finish_takes()


def _check_counts(counts: set[int], wanted: int, model: str) -> None:
    if counts != {wanted}:
        raise RuntimeError(f"{model} made {sorted(counts)} frames, {wanted} were due")


def _with_progress(
    moving: Iterator[list[Motion]], progress: Progress | None, before: int, takes: int, source: SpeechSource, tail: float
) -> Iterator[list[Motion]]:
    """The same stream, and the listener of progress is told; ``before`` of the takes were played in earlier passes."""
    seconds = None if source.expected_seconds is None else source.expected_seconds + tail
    for pieces in moving:
        yield pieces
        if progress is not None:
            done = pieces[0].start + pieces[0].duration
            if seconds is None:
                progress(done, None)
            else:
                progress(done * len(pieces) + before * seconds, seconds * takes)


def _style_text(style: StyleLike) -> str:
    """A style as the report has it; nothing for the default one."""
    if isinstance(style, Mapping):
        return ",".join(f"{_style_text(who)}:{weight:g}" for who, weight in style.items())
    return "example" if isinstance(style, Motion) else os.fspath(style or "")


def _check_rivals(style: StyleLike, speaker: str | None, transcript: File | None, transcribe: bool, language: str) -> None:
    """Two ways of saying one thing must not disagree, and a language is that of words."""
    check_language(language, has_words=transcript is not None or transcribe)
    if transcribe and transcript is not None:
        raise InputError("both a transcript and transcribe are given", "choose one of them")
    if style is not None and speaker is not None and style != speaker:
        raise InputError(
            f"style {_style_text(style)!r} and speaker {speaker!r} are both given", "for this model a speaker is a style"
        )


def _check_names(
    audio: File, names: list[Path], read: Sequence[object], report: File | None, plan: object, plan_out: File | None
) -> None:
    """No file that is written would overwrite another one or what is read; but a plan may be written anew."""
    files = [path for path in read if isinstance(path, str | PathLike)]
    check_files(audio, names, files, report)
    if plan_out is not None:
        others = [*names, *([] if report is None else [Path(report)]), Path(plan_out)]
        check_apart(others, [audio, *(path for path in files if path is not plan)])


def _check_files(
    options: GenerationOptions,
    skeleton: File | Skeleton,
    bone_map: File | None,
    avatar: File | None,
    files: Sequence[Path],
) -> tuple[GenerationOptions, Skeleton | None, Avatar | None]:
    """What is asked for can be seen in the files; options, of which a map has read the clip of the style; the skeleton to
    retarget to, None for our own; and who is shown."""
    bones = None if bone_map is None else load_map(bone_map)
    for path in files:
        check_parts(path, options.parts, "the parts that were asked for are")
    suffixes = {path.suffix.lower() for path in files}
    target = None if skeleton == "humanoid" else check_skeleton(skeleton, suffixes, bones)
    clip = None if bones is None else read_clip_by_map(options.style, bones)
    if bones and target is None and avatar is None and clip is None:
        problem = "the map changes nothing: it is for the rig of --skeleton, for --avatar, or for the clip of --style"
        warnings.warn(problem, CospeechWarning, stacklevel=3)
    worn = None if avatar is None else check_avatar(avatar, suffixes, bones, options.parts)
    if bones and clip is None:
        check_map(bones, {} if target is None else {str(skeleton): target}, worn)
    shown = {part for suffix in suffixes for part in FORMATS[suffix].holds} & {*options.parts}
    if files:
        note_idle_gain(options.face_gain, shown, "no face is made, or no file holds one")
    return options if clip is None else replace(options, style=clip), target, worn
