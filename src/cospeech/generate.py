"""Generate motion files for a speech file, in constant memory: the call behind ``cospeech generate``.

Sound is decoded in blocks, and a model turns each block into motion. All files are written at the same time, and as many takes
as the model can play in one pass. Files appear under their names only when all of them are complete.
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
from .audio.word import Word
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
TAIL_RANGE = (0.0, 60.0)  # seconds [ours: a larger number is a typing error]
Progress = Callable[[float, float | None], None]
"""Called now and then with the seconds done and the seconds in all (None if not known yet)."""


def generate_files(
    audio: File, outputs: File | Sequence[File], *, model: str = DEFAULT, style: StyleLike = None,
    emotion: str | PathLike[str] | EmotionTrack = "auto", speaker: str | None = None, transcript: File | None = None,
    transcribe: bool = False, language: str = "", seed: int = 0, takes: int = 1, temperature: float = 1.0,
    intensity: float = 1.0, parts: Iterable[str] = PARTS, face_gain: FaceGain = 1.0, face: MotionLike = None,
    continue_from: MotionLike = None, plan: File | Plan | None = None, plan_out: File | None = None,
    plan_edits: PlanCommands = NO_EDITS, keep: str = "", keep_from: MotionLike = None, skeleton: File | Skeleton = "humanoid",
    bone_map: File | None = None, fps: float = 30.0, tail: float = 0.0, avatar: File | None = None, report: File | None = None,
    special: Mapping[str, Mapping[str, object]] | None = None, progress: Progress | None = None, instance: Model | None = None,
    role: DialogueRole | None = None,
) -> Report:  # fmt: skip
    """Generate motion for a sound file, and write it to files.

    Args:
        audio: the speech; any sound file that `open_speech` reads.
        outputs: files to write, or one; the suffix chooses the format.
        model: registry name, bundle (``mine.cospeech``) or folder of a run.
        style: name of a style; for trained systems also a motion file or a `Motion` as an example, and mixtures:
            ``"ada:0.7,clip.bvh:0.3"``, or a dict from these to weights. The default is that of the model.
        emotion: one of `cospeech.audio.emotions.EMOTIONS`, or ``auto``, which follows the voice. For an emotion that changes
            over time, an `EmotionTrack` or its ``.csv`` file (`read_emotion_track`).
        speaker: name of a speaker; for the rule-based model, speakers are styles.
        transcript: words of the speech, with or without times; the default is those of the plan.
        transcribe: recognise the words with faster-whisper (the extra ``asr``) instead.
        language: of the words, a code of `cospeech.audio.languages.LANGUAGES`; if empty, it is detected from the words.
        seed: of the first take; the next take has the next seed.
        takes: number of takes; from two on, ``talk.bvh`` becomes ``talk.1.bvh``, ``talk.2.bvh`` …
        temperature: size of the random variation, 0 … 2; with 0, the likeliest choices are made.
        intensity: size of the motion, 0 … 2.
        parts: of `PARTS`.
        face_gain: strength of the mouth, 0 … 2, or of single channels: see `cospeech.face.gains.face_gains`.
        face: a `Motion` with a face, or its file. It replaces the model's face, and body and hands follow it; for chains.
        continue_from: a `Motion`, or its file. The new motion begins with its last poses; for chains.
        plan: a `Plan` of the gestures, or its file; its style, emotion, seed, intensity and temperature are used.
        plan_out: file for the plan that was performed.
        plan_edits: changes of the plan before it is played; without ``plan``, of the plan that the seed gives.
        keep: stretches of ``keep_from`` that replace the new motion: ``0:3.2,5:7``, seconds.
        keep_from: a `Motion`, or its file.
        skeleton: of the BVH files: a name, or the file of a rig (``my_rig.bvh``, ``.glb``, ``.vrm``).
        bone_map: a TOML file that gives our names to the joints of this rig or of the avatar, if they are not recognised.
        fps: frames per second; every file has exactly ceil(duration × fps) frames, with the duration of speech and tail.
        tail: seconds of silence after the speech, 0 … 60, in which the hands come down.
        avatar: a VRM, GLB or FBX character in place of our mannequin.
        report: JSON file for the `Report`.
        special: suffix → keywords for the writer of that format, such as ``{".bvh": {"units": "m"}}``.
        progress: called with (seconds done, seconds in all or None).
        instance: the model itself, if it is in memory already; ``model`` is its name then.
        role: the person's role in a conversation. The voice is that of the role; the person listens while another one speaks.

    Raises:
        InputError: an argument cannot be used; nothing has been written.
    """
    start = time.perf_counter()
    check_range("tail", tail, TAIL_RANGE)
    _check_rivals(style, speaker, transcript, transcribe, language)
    files = [Path(path) for path in ([outputs] if isinstance(outputs, str | PathLike) else outputs)]
    emotion_option, track = read_emotion(emotion)
    options = GenerationOptions(
        style=style or speaker, emotion=emotion_option, seed=seed, intensity=intensity, temperature=temperature, fps=fps,
        takes=takes, parts=tuple(parts), face_gain=face_gain, face=face, continue_from=continue_from)  # fmt: skip
    silence = Fraction(tail).limit_denominator(1000)
    lister = partial(_list_gestures, instance, model, audio, transcript, transcribe, language, silence)
    options = with_plan(options, plan, plan_edits, audio, transcript, writes_plan=plan_out is not None, list_gestures=lister)
    old, original_style = keep_stretches(keep, keep_from, options.fps), options.style
    options, target, character = _check_files(options, skeleton, bone_map, avatar, files)
    names = [take_path(path, take, takes) for take in range(1, takes + 1) for path in files]
    inputs = (transcript, avatar, track, bone_map, face, continue_from, plan, keep_from)
    others = [path for path in (*inputs, *rig_files(skeleton), *example_files(original_style)) if path]
    _check_names(audio, names, others, report, plan, plan_out)
    instance = _check_parts(instance or load_model(model), model, options, files)
    with ExitStack() as stack:
        place = stack.enter_context(all_or_none([*names, *(Path(path) for path in (report, plan_out) if path)]))
        source = stack.enter_context(_open_source(role, audio, transcript, language))
        if old:
            old.check_length(source.expected_seconds, tail)
        source.words = _recognise(audio, language, instance, options) if transcribe else source.words
        words = options.plan.speech_words if source.words is None and options.plan is not None else source.words
        note_unread_words(words if "face" in options.parts else None)
        keywords = writer_keywords(files, audio, character, special or {}, words)
        counts = set[int]()
        for group, performance in _passes(instance, options):
            temp_paths = [[place(take_path(path, take + 1, takes)) for path in files] for take in group]
            chunks = speech_chunks(source, silence)
            pieces = _play_takes(performance, chunks if group.start else note_level(chunks, source.name))
            pieces = role.listen(pieces, options, group) if role else pieces
            output_pieces = _with_progress(old.over(pieces) if old else pieces, progress, group.start, takes, source, tail)
            counts |= write_takes(output_pieces, temp_paths, target, options.fps, keywords)
        assert source.duration is not None
        seconds, frames = float(source.duration + silence), count_frames(source.duration + silence, options.fps)
        _check_counts(counts, frames, model)
        result = Report(
            model=model, speech=source.name, speech_seconds=seconds, frames=frames, fps=options.fps, seed=options.seed,
            takes=takes, realtime_factor=(time.perf_counter() - start) / (seconds * takes), emotion=performance.emotion,
            played=performance.expression, arousal=performance.arousal, speaker=performance.speaker, version=__version__,
            style=_style_text(original_style) or instance.default_style, style_mixture=performance.style_mixture,
            **describe_language(words, language), outputs=[str(path) for path in names])  # fmt: skip
        if plan_out is not None:
            place(Path(plan_out)).write_text(cast(PlannedSession, performance).plan.to_json(), "utf-8", newline="\n")
        if report:
            place(Path(report)).write_text(result.to_json(), "utf-8", newline="\n")
    return result


def _open_source(role: DialogueRole | None, audio: File, transcript: File | None, language: str) -> SpeechSource:
    """Open the speech of a file, or of one person in a conversation."""
    return role.open(transcript, language) if role else open_speech(audio, transcript=transcript, language=language)


def _recognise(audio: File, language: str, instance: Model, options: GenerationOptions) -> tuple[Word, ...]:
    """Recognise the words of a speech, once the model can work with the options: a recogniser works for minutes.

    Raises:
        InputError: the model cannot, or the recogniser is not installed or failed.
    """
    next(_passes(instance, replace(options, takes=1)))
    return with_language(align_with_recogniser(audio), language)


def _list_gestures(
    instance: Model | None, model: str, audio: File, transcript: File | None, transcribe: bool, language: str,
    silence: Fraction, options: GenerationOptions,
) -> Plan:  # fmt: skip
    """The plan with all gestures that the model performs with these options, whose own plan is open.

    Raises:
        InputError: the words are not known yet (``transcribe``), or the model plans no gestures.
    """
    if transcribe:
        hint = "pass --plan plan.json, which --plan-out plan.json writes"
        raise InputError("no gesture can be named before the words are recognised", hint)
    _, session = next(_passes(instance or load_model(model), replace(options, parts=("body", "hands"))))
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
        audio, transcript, language, tail, role, emotion: see `generate_files`.
        model: a name, a bundle or a run; or a model.
        options: other fields of `cospeech.rules.options.GenerationOptions`, for one take.

    Raises:
        InputError: an argument cannot be used.
    """
    check_range("tail", tail, TAIL_RANGE)
    instance = load_model(model) if isinstance(model, str | PathLike) else model
    request = GenerationOptions.from_keywords({"emotion": read_emotion(emotion)[0], **options})
    group, performance = next(_passes(instance, request))
    with _open_source(role, audio, transcript, language) as source:
        pieces = _play_takes(performance, speech_chunks(source, Fraction(tail).limit_denominator(1000)))
        for takes in role.listen(pieces, request, group) if role else pieces:
            yield takes[0]


def check_request(
    instance: Model,
    *,
    style: StyleLike = None,
    emotion: str | PathLike[str] | EmotionTrack = "auto",
    speaker: str | None = None,
    **options: Any,
) -> None:
    """Check, before `generate_files` is called, that a model can work with these options.

    Args:
        instance: the model.
        style, emotion, speaker: see `generate_files`.
        options: other fields of `cospeech.rules.options.GenerationOptions`.

    Raises:
        InputError: it cannot.
    """
    _check_rivals(style, speaker, None, False, "")
    request = GenerationOptions.from_keywords({"style": style or speaker, "emotion": read_emotion(emotion)[0], **options})
    next(_passes(instance, replace(request, takes=1)))


def _check_parts(instance: Model, model: str, options: GenerationOptions, files: Sequence[Path]) -> Model:
    """Check that the model moves a part that each file holds, and return the model.

    Raises:
        InputError: it does not.
    """
    parts = [part for part in options.parts if part in instance.makes]
    if not parts:
        raise InputError(f"{model} makes no {' and no '.join(options.parts)}", f"it makes {' and '.join(instance.makes)}")
    for path in files:
        check_parts(path, parts, f"{model} makes")
    return instance


def take_path(path: File, take: int, takes: int) -> Path:
    """File of a take: the path itself if there is one take, else with the number before the suffix.

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
        InputError: an option is out of range, a name or an option is unknown, or a plan is given, which only fits one speech.
    """
    from .runtime.live_session import LiveSession

    if options.get("plan") is not None:
        raise InputError("a live session plays no plan", "a plan is that of one speech: generate, or model.session(plan=…)")
    instance = load_model(model) if isinstance(model, str | PathLike) else model
    usual = {name: value for name, value in instance.for_files.items() if name in ("stance", "rests", "arm_limits")}
    settings = GenerationOptions.from_keywords({**usual, "emotion": read_emotion(emotion)[0], **options})
    if "rests" not in options and not (settings.look_ahead is None and "face" in settings.parts):
        settings = replace(settings, rests=False)  # rests need the longest look-ahead
    return LiveSession(instance, settings, idle_after=idle_after, angle=angle)


def _passes(instance: Model, options: GenerationOptions) -> Iterator[tuple[range, GenerationSession]]:
    """Yield the numbers of the takes that are played together, from 0 on, and the session that plays them."""
    for first in range(0, options.takes, instance.takes_at_once):
        group = range(first, min(first + instance.takes_at_once, options.takes))
        pass_options = replace(options, seed=options.seed + first, takes=len(group), **instance.for_files)
        yield group, instance.session(pass_options)


def _play_takes(performance: GenerationSession, chunks: Iterable[Speech]) -> Iterator[list[Motion]]:
    """Play the takes of one pass from beginning to end; yields a piece of each take at a time."""
    for chunk in chunks:
        yield from performance.push_takes(chunk)
    yield from performance.finish_takes()


def _check_counts(counts: set[int], frames: int, model: str) -> None:
    if counts != {frames}:
        raise RuntimeError(f"{model} made {sorted(counts)} frames, {frames} were due")


def _with_progress(
    stream: Iterator[list[Motion]], progress: Progress | None, before: int, takes: int, source: SpeechSource, tail: float
) -> Iterator[list[Motion]]:
    """Yield the pieces of a stream, and call ``progress`` after each; earlier passes have played ``before`` takes."""
    seconds = None if source.expected_seconds is None else source.expected_seconds + tail
    for pieces in stream:
        yield pieces
        if progress is not None:
            position = pieces[0].start + pieces[0].duration
            if seconds is None:
                progress(position, None)
            else:
                progress(position * len(pieces) + before * seconds, seconds * takes)


def _style_text(style: StyleLike) -> str:
    """A style as text for the report; empty for the default style."""
    if isinstance(style, Mapping):
        return ",".join(f"{_style_text(who)}:{weight:g}" for who, weight in style.items())
    return "example" if isinstance(style, Motion) else os.fspath(style or "")


def _check_rivals(style: StyleLike, speaker: str | None, transcript: File | None, transcribe: bool, language: str) -> None:
    """Check that options which mean the same do not contradict each other, and that a language is given only with words."""
    check_language(language, has_words=transcript is not None or transcribe)
    if transcribe and transcript is not None:
        raise InputError("both a transcript and transcribe are given", "choose one of them")
    if style is not None and speaker is not None and style != speaker:
        raise InputError(
            f"style {_style_text(style)!r} and speaker {speaker!r} are both given", "for this model a speaker is a style"
        )


def _check_names(
    audio: File, names: list[Path], inputs: Sequence[object], report: File | None, plan: object, plan_out: File | None
) -> None:
    """Check that no output is another output or a file that is read; only the plan may be read and written again."""
    files = [path for path in inputs if isinstance(path, str | PathLike)]
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
    """Check that the files can hold what the options ask for.

    Returns:
        The options, with the style's clip if the map is needed to read it; the skeleton to retarget to, None for our own; and
        the avatar.
    """
    bones = None if bone_map is None else load_map(bone_map)
    for path in files:
        check_parts(path, options.parts, "the parts that were asked for are")
    suffixes = {path.suffix.lower() for path in files}
    target = None if skeleton == "humanoid" else check_skeleton(skeleton, suffixes, bones)
    clip = None if bones is None else read_clip_by_map(options.style, bones)
    if bones and target is None and avatar is None and clip is None:
        problem = "the map changes nothing: it is for the rig of --skeleton, for --avatar, or for the clip of --style"
        warnings.warn(problem, CospeechWarning, stacklevel=3)
    character = None if avatar is None else check_avatar(avatar, suffixes, bones, options.parts)
    if bones and clip is None:
        check_map(bones, {} if target is None else {str(skeleton): target}, character)
    visible_parts = {part for suffix in suffixes for part in FORMATS[suffix].holds} & {*options.parts}
    if files:
        note_idle_gain(options.face_gain, visible_parts, "no face is made, or no file holds one")
    return options if clip is None else replace(options, style=clip), target, character
