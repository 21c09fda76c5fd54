"""``cospeech generate`` for several speeches: it finds the sound files, generates motion for each, and reports."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import fields, replace
from multiprocessing import get_context
from os import PathLike
from pathlib import Path
from typing import Any

from ..errors import CospeechError, CospeechWarning, InputError, InternalError
from ..export import FORMATS
from ..files import atomic, check_destination, make_folders, regular_file, scratch, workplace
from ..generate import check_request, generate_files
from ..limits import PIPED_BYTES
from ..models import DEFAULT, PARTS, Model, load
from ..rules.options import GenerationOptions, check_range
from ..runtime.report import Failure, Report, Reports
from ..training.interrupts import list_stop_signals
from .batch_files import Job, check_files_of_jobs, check_left_out, check_new, list_undone, make_job
from .several import NAME, FoundFiles, LeftOut, find_files
from .unexpected import ends_work, explain

__all__ = ["STANDARD_INPUT", "generate_speeches"]

STANDARD_INPUT = "-"
_BLOCK = 1 << 20  # bytes
_MOST_JOBS = (1, 64)  # ours: more processes than that only wait for each other
_OF_MODELS = frozenset({"speaker", *(field.name for field in fields(GenerationOptions))})

_reasons_to_stop: list[Callable[[], bool]] = []
"""Functions of a worker process; if one returns True, the process stops: the main program asked for it, or a signal came."""

Progress = Callable[[float, float | None, str], None]


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
    """Generate motion for several sound files, each by itself. An error in one does not stop the others; a full disk does.

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
        OSError: no room is left on the disk; the report has been written, if it had room.
    """
    check_range("jobs", jobs, _MOST_JOBS)
    if not outputs and _is_standard_input(speeches):
        raise InputError("no file to write for standard input", f"-o FILE, with a suffix of {' '.join(FORMATS)}")
    with _find_speeches(speeches) as (files, left_out):
        instance = load(model)
        options = {"parts": PARTS, **options}
        parts = {*options["parts"]} & {*instance.makes}
        work = [make_job(name, path, outputs, options, parts, several=len(files) > 1) for name, path in files.items()]
        if not (outputs or resume):
            check_new(work, options)
        if left_out:
            check_left_out(work, options, report, left_out)
        if resume or len(files) > 1:
            check_files_of_jobs(work, options, report)
        if resume:
            work = list_undone(work, options)
            if not outputs:  # nothing is there of a speech that an interruption has left: its files come together
                check_new(work, options)
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
        result = Reports(speeches=[], failed=[])
        with _write_at_the_end(report, result):
            if jobs == 1:
                _each(work, options, model, instance, progress, result)
            else:
                _each_in_parallel(work, options, model, progress, jobs, result)
        return result


@contextmanager
def _write_at_the_end(report: str | PathLike[str] | None, result: Reports) -> Iterator[None]:
    """Write the reports after the work; after an error that ends it, too, if there is room for them."""
    try:
        yield
    except Exception:
        with suppress(OSError, CospeechError):  # the error that has ended the work is the one to tell
            _write_report(report, result)
        raise
    _write_report(report, result)


def _write_report(report: str | PathLike[str] | None, result: Reports) -> None:
    if report is not None:
        with atomic(report) as path:
            path.write_text(result.to_json(), "utf-8", newline="\n")


def _fail(job: Job, error: Exception) -> Failure:
    """What the report says about a speech that failed."""
    own = explain(error, "generate")
    return Failure(speech=str(job.speech), error=str(own), ours=isinstance(own, InternalError))


def _each(
    jobs: list[Job], options: Mapping[str, Any], model: str, instance: Model, progress: Progress | None, result: Reports
) -> None:
    """Generate motion for one speech after the other, and add the outcomes to ``result``."""
    for number, job in enumerate(jobs, 1):
        word = f"{number} of {len(jobs)}: {job.name}"
        tell = None if progress is None else lambda amount, total, word=word: progress(amount, total, word)  # type: ignore[misc]
        try:
            result.speeches.append(_generate_one(job, options, model=model, instance=instance, progress=tell))
        except Exception as error:
            result.failed.append(_fail(job, error))
            if ends_work(error):
                raise


def _each_in_parallel(
    work: list[Job], options: Mapping[str, Any], model: str, progress: Progress | None, jobs: int, result: Reports
) -> None:
    """Generate motion for several speeches at the same time, and add the outcomes to ``result`` in the order of the speeches.

    If a process dies, the speeches that are not done are failures.
    """
    context = get_context("spawn")  # a fork would copy the threads of onnxruntime as they are
    stop = context.Event()
    with ProcessPoolExecutor(min(jobs, len(work)), context, _watch_signals, (stop.is_set,)) as pool:
        with _hold_signals():  # a signal before `_watch_signals` would end a process with a traceback
            waiting = [pool.submit(_generate_alone, job, dict(options), model) for job in work]
        pairs = list(zip(work, waiting, strict=True))
        number = 0
        try:
            for number, (job, future) in enumerate(pairs, 1):
                _add_outcome(job, future, result)
                if progress is not None:
                    progress(number, len(work), f"{number} of {len(work)}: {job.name}")
        except BaseException as error:
            stop.set()
            pool.shutdown(cancel_futures=True)
            for job, future in pairs[number:] if isinstance(error, Exception) else ():
                if not future.cancelled() and future.exception() is None:
                    _add_outcome(job, future, result)
            raise


def _add_outcome(job: Job, future: Future[tuple[Report | Failure, list[str]]], result: Reports) -> None:
    """Wait for the outcome of a speech, print its notes, and add it to ``result``; an error that ends all work is raised."""
    try:
        outcome, notes = future.result()
    except BrokenProcessPool:
        death = InternalError(
            "a process that generates has ended, as if it were killed", "is there room in memory? --resume makes the rest"
        )
        outcome, notes = _fail(job, death), []
    except Exception as error:
        result.failed.append(_fail(job, error))
        raise
    for note in notes:
        warnings.warn(note, CospeechWarning, stacklevel=3)
    if isinstance(outcome, Report):
        result.speeches.append(outcome)
    else:
        result.failed.append(outcome)


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


def _generate_alone(job: Job, options: dict[str, Any], model: str) -> tuple[Report | Failure, list[str]]:
    """Generate motion for one speech in a worker process. Also returns its notes, which the main process prints."""
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always", CospeechWarning)
        try:
            _check_stop()
            outcome: Report | Failure = _generate_one(job, options, model=model, progress=_check_stop)
        except Exception as error:
            if ends_work(error):
                raise
            outcome = _fail(job, error)
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


def _generate_one(job: Job, options: Mapping[str, Any], **more: Any) -> Report:
    """Generate motion for one of several speeches."""
    with _tell_paths(job.speech):
        return replace(_generate(job, options, **more), speech=str(job.speech))


def _generate(job: Job, options: Mapping[str, Any], **more: Any) -> Report:
    with make_folders(job.folders):
        return generate_files(job.speech, job.outputs, **{**options, **job.own, **more})


def _is_standard_input(speeches: Sequence[str | PathLike[str]]) -> bool:
    return [os.fspath(speech) for speech in speeches] == [STANDARD_INPUT]


@contextmanager
def _find_speeches(speeches: Sequence[str | PathLike[str]]) -> Iterator[FoundFiles]:
    """Yield the files that `find_files` finds, or a file with the bytes of standard input.

    Raises:
        InputError: as of `find_files`; or standard input is closed, too large, or named together with other speeches.
    """
    if _is_standard_input(speeches):
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
