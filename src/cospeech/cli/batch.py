"""``cospeech generate`` for several speeches: it finds the sound files, generates motion for each, and reports."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import fields, replace
from multiprocessing import get_context
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import CospeechError, CospeechWarning, InputError, InternalError, say_count
from ..export import FORMATS
from ..export.checks import check_apart, check_files
from ..files import atomic, check_destination, make_folders, regular_file, scratch, workplace
from ..generate import check_request, generate_files, take_path
from ..limits import PIPED_BYTES
from ..models import DEFAULT, PARTS, Model, load
from ..rules.options import GenerationOptions, check_range
from ..runtime.report import Failure, Report, Reports
from ..runtime.styles.style import example_files
from ..training.interrupts import list_stop_signals
from .several import NAME, FoundFiles, LeftOut, find_files, put_name

__all__ = ["STANDARD_INPUT", "generate_speeches"]

STANDARD_INPUT = "-"
_BLOCK = 1 << 20  # bytes
_MOST_JOBS = (1, 64)  # ours: more processes than that only wait for each other
_USUAL = (".bvh", ".glb")  # formats that are written where none is named
_OF_ONE_SPEECH = {
    "transcript": f"words/{NAME}.srt", "face": f"faces/{NAME}.csv", "plan": f"plans/{NAME}.json",
    "plan_out": f"plans/{NAME}.json", "keep_from": f"old/{NAME}.npz",
}  # fmt: skip
"""Options that need a value of its own for each speech → an example, for the hint."""
_WITH_NAME = (*_OF_ONE_SPEECH, "emotion", "continue_from")  # options whose value may have `NAME` in it
_OF_ALL = ("emotion", "continue_from", "bone_map", "skeleton", "avatar")
"""Options that may name a file which all speeches share."""
_OF_MODELS = frozenset({"speaker", *(field.name for field in fields(GenerationOptions))})

_reasons_to_stop: list[Callable[[], bool]] = []
"""Functions of a worker process; if one returns True, the process stops: the main program asked for it, or a signal came."""

Progress = Callable[[float, float | None, str], None]


class _Job(NamedTuple):
    """A speech, and the files to make of it."""

    speech: Path
    name: str
    outputs: list[Path]
    folders: set[Path]
    """Folders that are made if they are missing."""
    own: dict[str, Any]
    """Options of this speech alone."""


def generate_speeches(
    speeches: Sequence[str | PathLike[str]],
    outputs: Sequence[str] = (),
    *,
    model: str = DEFAULT,
    report: str | PathLike[str] | None = None,
    progress: Progress | None = None,
    jobs: int = 1,
    resume: bool = False,
    **options: Any,
) -> Reports:
    """Generate motion for several sound files, each by itself. An error in one does not stop the others.

    Args:
        speeches: sound files, folders, or patterns of both, with ``*``, ``?``, ``[`` or ``**``. A folder stands for all sound
            files in it and in the folders below it; hidden files are left out, and so is a video beside a sound file of the
            same name. ``"-"`` alone reads one sound file from standard input.
        outputs: files or folders to write for each speech. For several speeches, a file has ``{name}`` in its name. A folder
            ends with a slash or exists already; it gets a .bvh and a .glb. The default is these two in the working folder; then
            no existing file is replaced.
        model: as for `cospeech.generate.generate_files`.
        report: JSON file for the `Report` of one speech, or the `Reports` of several.
        progress: called with (seconds done, seconds in all or None, which speech).
        jobs: number of speeches that are generated at the same time, 1 … 64, each in its own process.
        resume: leave out a speech if all its files exist and are newer than it; a note tells how many.
        options: as for `generate_files`. transcript, emotion, face, continue_from, plan, plan_out and keep_from may have
            ``{name}`` in them.

    Raises:
        InputError: an argument cannot be used; nothing has been written. Also if the only speech cannot be used.
    """
    check_range("jobs", jobs, _MOST_JOBS)
    with _find_speeches(speeches) as (files, left_out):
        instance = load(model)
        options = {"parts": PARTS, **options}
        parts = {*options["parts"]} & {*instance.makes}
        work = [_job(name, path, outputs, options, parts, several=len(files) > 1) for name, path in files.items()]
        if not outputs:
            _check_new(work, options)
        if left_out:
            _check_left_out(work, options, report, left_out)
        if resume or len(files) > 1:
            _check(work, options, report)
        if resume:
            work = _list_undone(work, options)
            if not work:
                return Reports(speeches=[], failed=[])
        if len(files) == 1:
            tell = None if progress is None else lambda amount, total: progress(amount, total, "")
            return Reports(
                speeches=[_generate(work[0], options, model=model, instance=instance, report=report, progress=tell)], failed=[]
            )
        request = {key: value for key, value in options.items() if key in _OF_MODELS and NAME not in str(value)}
        check_request(instance, **request)
        if report is not None:
            check_destination(report)
        if jobs == 1:
            result = _each(work, options, model, instance, progress)
        else:
            result = _each_in_parallel(work, options, model, progress, jobs)
        if report is not None:
            with atomic(report) as path:
                path.write_text(result.to_json(), "utf-8", newline="\n")
        return result


def _each(jobs: list[_Job], options: Mapping[str, Any], model: str, instance: Model, progress: Progress | None) -> Reports:
    """Generate motion for one speech after the other."""
    reports, failures = list[Report](), list[Failure]()
    for number, job in enumerate(jobs, 1):
        word = f"{number} of {len(jobs)}: {job.name}"
        tell = None if progress is None else lambda amount, total, word=word: progress(amount, total, word)  # type: ignore[misc]
        try:
            reports.append(_generate_one(job, options, model=model, instance=instance, progress=tell))
        except CospeechError as error:
            failures.append(Failure(speech=str(job.speech), error=str(error), ours=isinstance(error, InternalError)))
    return Reports(speeches=reports, failed=failures)


def _each_in_parallel(
    work: list[_Job], options: Mapping[str, Any], model: str, progress: Progress | None, jobs: int
) -> Reports:
    """Generate motion for several speeches at the same time; the reports are in the order of the speeches."""
    reports, failures = list[Report](), list[Failure]()
    context = get_context("spawn")  # a fork would copy the threads of onnxruntime as they are
    stop = context.Event()
    with ProcessPoolExecutor(min(jobs, len(work)), context, _watch_signals, (stop.is_set,)) as pool:
        with _hold_signals():  # a signal before `_watch_signals` would end a process with a traceback
            waiting = [pool.submit(_generate_alone, job, dict(options), model) for job in work]
        try:
            for number, (job, future) in enumerate(zip(work, waiting, strict=True), 1):
                outcome, notes = future.result()
                for note in notes:
                    warnings.warn(note, CospeechWarning, stacklevel=2)
                (reports if isinstance(outcome, Report) else failures).append(outcome)  # type: ignore[arg-type]
                if progress is not None:
                    progress(number, len(work), f"{number} of {len(work)}: {job.name}")
        except BaseException:
            stop.set()
            pool.shutdown(cancel_futures=True)
            raise
    return Reports(speeches=reports, failed=failures)


@contextmanager
def _hold_signals() -> Iterator[None]:
    """Block signals for a while; they arrive afterwards. Processes that start meanwhile inherit the block."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, list_stop_signals())
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _watch_signals(must_stop: Callable[[], bool]) -> None:
    """Prepare a worker process: after a signal it stops at the next piece, and leaves no half-written file.

    Args:
        must_stop: whether the main program has asked the process to stop.
    """
    _reasons_to_stop.append(must_stop)
    for number in list_stop_signals():
        signal.signal(number, lambda *_: _reasons_to_stop.append(lambda: True))
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, list_stop_signals())


def _check_stop(amount: float = 0.0, total: float | None = None) -> None:
    if any(reason() for reason in _reasons_to_stop):
        raise KeyboardInterrupt


def _generate_alone(job: _Job, options: dict[str, Any], model: str) -> tuple[Report | Failure, list[str]]:
    """Generate motion for one speech in a worker process. Also returns its notes, which the main process prints."""
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always", CospeechWarning)
        try:
            _check_stop()
            outcome: Report | Failure = _generate_one(job, options, model=model, progress=_check_stop)
        except CospeechError as error:
            outcome = Failure(speech=str(job.speech), error=str(error), ours=isinstance(error, InternalError))
    return outcome, [str(warning.message) for warning in notes if issubclass(warning.category, CospeechWarning)]


@contextmanager
def _tell_paths(speech: Path) -> Iterator[None]:
    """Put the path of a speech into notes in place of its name: many folders have a ``line1.wav``."""
    with warnings.catch_warnings():
        usual = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: Any) -> None:
            text = str(message)
            if issubclass(category, CospeechWarning) and str(speech) not in text:
                message = category(text.replace(speech.name, str(speech), 1))
            usual(message, category, *where)

        warnings.showwarning = show  # type: ignore[assignment]
        yield


def _generate_one(job: _Job, options: Mapping[str, Any], **more: Any) -> Report:
    """Generate motion for one of several speeches."""
    with _tell_paths(job.speech):
        return replace(_generate(job, options, **more), speech=str(job.speech))


def _generate(job: _Job, options: Mapping[str, Any], **more: Any) -> Report:
    with make_folders(job.folders):
        return generate_files(job.speech, job.outputs, **{**options, **job.own, **more})


@contextmanager
def _find_speeches(speeches: Sequence[str | PathLike[str]]) -> Iterator[FoundFiles]:
    """Yield the files that `find_files` finds, or a file with the bytes of standard input.

    Raises:
        InputError: as of `find_files`; or standard input is closed, too large, or named together with other speeches.
    """
    if [os.fspath(speech) for speech in speeches] == [STANDARD_INPUT]:
        with _read_standard_input() as path:
            yield FoundFiles({path.name: path}, {})
        return
    for speech in speeches:
        if os.fspath(speech) == STANDARD_INPUT:
            raise InputError("standard input (-) is named together with other speeches", "name it alone")
        if "://" in os.fspath(speech):  # a `Path` would drop a slash of the address
            regular_file(speech)
    from ..corpora.folder import SOUND

    yield find_files(map(Path, speeches), _list_sounds, "sound", SOUND)


def _list_sounds(folder: Path, left_out: LeftOut) -> list[tuple[str, Path]]:
    """Sound files of a folder. A video beside a sound of the same name is left out: it is the recording, or our own film."""
    from ..corpora.clip import Dropped
    from ..corpora.folder import VIDEO, sounds
    from ..export.mp4 import is_own_film

    omissions: list[Dropped] = []
    files = list(sounds(folder, omissions))
    sound_names = {name for name, each in files if each.suffix.lower() not in VIDEO}
    videos = [each for name, each in files if name in sound_names and each.suffix.lower() in VIDEO]
    left_out |= dict.fromkeys((each for each in videos if not is_own_film(each)), "a sound of the same name is beside it")
    left_out |= {folder / item.name: item.reason for item in omissions}
    exclusions = {*videos, *left_out}
    return [(name, each) for name, each in files if each not in exclusions]


@contextmanager
def _read_standard_input() -> Iterator[Path]:
    """Copy standard input to a file, and yield the file.

    Raises:
        InputError: standard input is a terminal, empty, or larger than `PIPED_BYTES`.
    """
    if sys.stdin is None or sys.stdin.isatty():
        raise InputError("there is no sound on standard input", "pipe it in: recorder | cospeech generate - -o talk.bvh")
    with workplace(scratch()) as place:
        path, size = place / "stdin", 0
        with path.open("wb") as file:
            while block := sys.stdin.buffer.read(_BLOCK):
                size += len(block)
                if size > PIPED_BYTES:
                    raise InputError(f"more than {PIPED_BYTES >> 30} GiB on standard input", "save it to a file first")
                file.write(block)
        if not size:
            raise InputError("there is no sound on standard input: 0 bytes", "did the program before the pipe fail?")
        yield path


def _job(
    name: str, speech: Path, targets: Sequence[str], options: Mapping[str, Any], parts: set[str], *, several: bool
) -> _Job:
    """The files to make of a speech, and its own options.

    Args:
        name, speech: its name and file.
        targets: the outputs as the user named them.
        options: of `generate_files`.
        parts: the parts that move.
        several: whether there are other speeches.

    Raises:
        InputError: several speeches would share one file.
    """
    if not targets and name == "stdin":
        raise InputError("no file to write for standard input", f"-o FILE, with a suffix of {' '.join(FORMATS)}")
    usual = [suffix for suffix in _USUAL if parts & {*FORMATS[suffix].holds}] or _USUAL
    outputs: list[Path] = []
    folders: set[Path] = set()
    for text in targets or ["."]:
        if NAME in text:
            own = [Path(text.replace(NAME, name))]
        elif _is_folder(text):
            own = [Path(text) / f"{name}{suffix}" for suffix in usual]
        elif several:
            suffix = Path(text).suffix or ".bvh"
            raise InputError(f"one file {text!r} for several speeches", f"a folder, -o out/, or -o 'out/{NAME}{suffix}'")
        else:
            outputs.append(Path(text))
            continue
        outputs += own
        folders |= {path.parent for path in own}
    for key in _OF_ONE_SPEECH:
        if several and options.get(key) is not None and NAME not in str(options[key]):
            hint = f"one for each, with {NAME} in it: {_OF_ONE_SPEECH[key]}"
            raise InputError(f"one {key} {str(options[key])!r} for several speeches", hint)
    own_options = {key: put_name(options[key], name) for key in _WITH_NAME if NAME in str(options.get(key))}
    if "plan_out" in own_options:
        own_options["plan_out"] = str(options["plan_out"]).replace(NAME, name)
        folders.add(Path(own_options["plan_out"]).parent)
    return _Job(speech, name, outputs, folders, own_options)


def _check_new(jobs: list[_Job], options: Mapping[str, Any]) -> None:
    """Raise an InputError if an output that the user did not name exists: it may be the recording of a speech."""
    takes = int(options.get("takes", 1))
    existing = [path for job in jobs for path in _takes(job, takes) if path.exists()]
    if existing:
        are = f" and {len(existing) - 1} more are" if len(existing) > 1 else " is"
        hint = f"-o {existing[0]} writes over it" if len(existing) == 1 else "-o ./ writes over them"
        raise InputError(f"{str(existing[0])!r}{are} there already", f"{hint}; -o out/ writes to another folder")


def _check_left_out(
    jobs: list[_Job], options: Mapping[str, Any], report: str | PathLike[str] | None, left_out: LeftOut
) -> None:
    """Raise an InputError if an output is a file that was left out beside the speeches: it may be a recording."""
    takes = int(options.get("takes", 1))
    plans = [job.own.get("plan_out", options.get("plan_out")) for job in jobs]
    others = [Path(path) for path in (*plans, report) if path is not None]
    check_apart([*(path for job in jobs for path in _takes(job, takes)), *others], [*left_out])


def _takes(job: _Job, takes: int) -> list[Path]:
    return [take_path(path, take, takes) for take in range(1, takes + 1) for path in job.outputs]


def _list_undone(jobs: list[_Job], options: Mapping[str, Any]) -> list[_Job]:
    """Jobs with an output that is missing, or older than the speech or a file of its own options; a note counts the others."""
    remaining = [job for job in jobs if not _is_done(job, options)]
    if len(remaining) < len(jobs):
        text = f"{len(jobs) - len(remaining)} of {say_count(len(jobs), 'speech', 'speeches')} left out: their files are there"
        warnings.warn(f"{text} (--resume)", CospeechWarning, stacklevel=3)
    return remaining


def _is_done(job: _Job, options: Mapping[str, Any]) -> bool:
    values = {key: job.own.get(key, options.get(key)) for key in _OF_ONE_SPEECH}
    own = {key: Path(value) for key, value in values.items() if isinstance(value, str | PathLike)}
    outputs = [*_takes(job, int(options.get("takes", 1))), *([own.pop("plan_out")] if "plan_out" in own else [])]
    if not all(path.is_file() for path in outputs):
        return False
    input_times = [path.stat().st_mtime for path in (job.speech, *own.values()) if path.exists()]
    return max(input_times) <= min(path.stat().st_mtime for path in outputs)


def _is_folder(text: str) -> bool:
    """Whether the name of an output means a folder. A folder called ``x.bvh`` does not count: ``x.bvh`` means a file."""
    return text.endswith(("/", os.sep)) or (Path(text).suffix.lower() not in FORMATS and Path(text).is_dir())


def _check(jobs: list[_Job], options: Mapping[str, Any], report: str | PathLike[str] | None) -> None:
    """Raise an InputError if two speeches share an output, or an output is a file that is read."""
    takes = int(options.get("takes", 1))
    names = [path for job in jobs for path in _takes(job, takes)]
    first, *speeches = (job.speech for job in jobs)
    inputs = [Path(job.own[key]) for job in jobs for key in _WITH_NAME if key in job.own]
    common = [options.get(key) for key in _OF_ALL if key not in jobs[0].own]
    inputs += [Path(path) for path in (*common, *example_files(options.get("style"))) if isinstance(path, str | PathLike)]
    if report is not None and NAME in str(report):
        raise InputError(f"a report of each speech, {str(report)!r}", "one file holds the reports of all: --report report.json")
    check_files(first, names, [*speeches, *inputs], None if report is None else Path(report))
