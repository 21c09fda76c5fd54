"""Several speeches at once: files, folders of them, standard input; what ``cospeech generate`` does with its arguments."""

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
_USUAL = (".bvh", ".glb")  # what is written where no format is named
_OF_ONE_SPEECH = {
    "transcript": f"words/{NAME}.srt", "face": f"faces/{NAME}.csv", "plan": f"plans/{NAME}.json",
    "plan_out": f"plans/{NAME}.json", "keep_from": f"old/{NAME}.npz",
}  # fmt: skip
"""Options that cannot be the same for several speeches, and what may be given."""
_WITH_NAME = (*_OF_ONE_SPEECH, "emotion", "continue_from")  # options in which `NAME` is put in
_OF_ALL = ("emotion", "continue_from", "bone_map", "skeleton", "avatar")
"""Options that may name a file which all speeches share."""
_OF_MODELS = frozenset({"speaker", *(field.name for field in fields(GenerationOptions))})

_reasons_to_stop: list[Callable[[], bool]] = []
"""Of a worker process: what the program has told, and signals that have come."""

Progress = Callable[[float, float | None, str], None]


class _Job(NamedTuple):
    """A speech, and the files to be made of it."""

    speech: Path
    name: str
    outputs: list[Path]
    folders: set[Path]
    """Those that are made where they are missing."""
    own: dict[str, str]
    """Options of it alone."""


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
    """Generate motion for several sound files, each by itself; what is wrong with one does not keep back the others.

    Args:
        speeches: sound files; folders, of which every sound file is taken, those in folders below too, but nothing hidden and
            no video beside a sound of its name; patterns of files and folders, with ``*``, ``?``, ``[`` or ``**``; or ``"-"``
            alone, for the bytes of one on standard input.
        outputs: what to write of each: a file, with ``{name}`` in it where there are several speeches; or a folder, named with
            a slash at its end or there already, for a .bvh and a .glb. Where not given: these two, in the working folder; no
            file that is there is written over then.
        model: as for `cospeech.generate.generate_files`.
        report: write the `Report` of one speech, or the `Reports` of several, as JSON here too.
        progress: called with (seconds done, seconds in all or None, which speech).
        jobs: how many speeches are generated at the same time, 1 … 64, each in a process of its own.
        resume: leave out speeches whose files are all there, and newer than the speech; a note tells how many.
        options: as for `generate_files`; transcript, emotion, face, continue_from, plan, plan_out and keep_from may have
            ``{name}`` in them.

    Raises:
        InputError: something given cannot be used; nothing has been written. Of a single speech, what is wrong with it, too.
    """
    check_range("jobs", jobs, _MOST_JOBS)
    with _find_speeches(speeches) as (found, left_out):
        loaded = load(model)
        options = {"parts": PARTS, **options}
        shown = {*options["parts"]} & {*loaded.makes}
        work = [_job(name, path, outputs, options, shown, several=len(found) > 1) for name, path in found.items()]
        if not outputs:
            _check_new(work, options)
        if left_out:
            _check_left_out(work, options, report, left_out)
        if resume or len(found) > 1:
            _check(work, options, report)
        if resume:
            work = _list_undone(work, options)
            if not work:
                return Reports(speeches=[], failed=[])
        if len(found) == 1:
            tell = None if progress is None else lambda done, total: progress(done, total, "")
            return Reports(
                speeches=[_generate(work[0], options, model=model, loaded=loaded, report=report, progress=tell)], failed=[]
            )
        asked = {key: value for key, value in options.items() if key in _OF_MODELS and NAME not in str(value)}
        check_request(loaded, **asked)
        if report is not None:
            check_destination(report)
        if jobs == 1:
            result = _each(work, options, model, loaded, progress)
        else:
            result = _each_in_parallel(work, options, model, progress, jobs)
        if report is not None:
            with atomic(report) as path:
                path.write_text(result.to_json(), "utf-8", newline="\n")
        return result


def _each(jobs: list[_Job], options: Mapping[str, Any], model: str, loaded: Model, progress: Progress | None) -> Reports:
    """One speech after the other."""
    made, failed = list[Report](), list[Failure]()
    for number, job in enumerate(jobs, 1):
        word = f"{number} of {len(jobs)}: {job.name}"
        tell = None if progress is None else lambda done, total, word=word: progress(done, total, word)  # type: ignore[misc]
        try:
            made.append(_generate_one(job, options, model=model, loaded=loaded, progress=tell))
        except CospeechError as error:
            failed.append(Failure(speech=str(job.speech), error=str(error), ours=isinstance(error, InternalError)))
    return Reports(speeches=made, failed=failed)


def _each_in_parallel(
    work: list[_Job], options: Mapping[str, Any], model: str, progress: Progress | None, jobs: int
) -> Reports:
    """Several speeches at the same time; the reports are in the order of the speeches."""
    made, failed = list[Report](), list[Failure]()
    context = get_context("spawn")  # a fork would copy the threads of onnxruntime as they are
    stop = context.Event()
    with ProcessPoolExecutor(min(jobs, len(work)), context, _watch_signals, (stop.is_set,)) as pool:
        with _hold_signals():  # until a process has begun to watch: one that comes before ends it with a traceback
            waiting = [pool.submit(_generate_alone, job, dict(options), model) for job in work]
        try:
            for number, (job, future) in enumerate(zip(work, waiting, strict=True), 1):
                found, notes = future.result()
                for note in notes:
                    warnings.warn(note, CospeechWarning, stacklevel=2)
                (made if isinstance(found, Report) else failed).append(found)  # type: ignore[arg-type]
                if progress is not None:
                    progress(number, len(work), f"{number} of {len(work)}: {job.name}")
        except BaseException:
            stop.set()
            pool.shutdown(cancel_futures=True)
            raise
    return Reports(speeches=made, failed=failed)


@contextmanager
def _hold_signals() -> Iterator[None]:
    """Signals come later, also to processes that are started meanwhile: these inherit it."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, list_stop_signals())
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _watch_signals(told: Callable[[], bool]) -> None:
    """At the start of a worker process: a signal ends its work at the next piece, so that nothing half-written is left."""
    _reasons_to_stop.append(told)
    for number in list_stop_signals():
        signal.signal(number, lambda *_: _reasons_to_stop.append(lambda: True))
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, list_stop_signals())


def _check_stop(done: float = 0.0, total: float | None = None) -> None:
    if any(reason() for reason in _reasons_to_stop):
        raise KeyboardInterrupt


def _generate_alone(job: _Job, options: dict[str, Any], model: str) -> tuple[Report | Failure, list[str]]:
    """One speech, in a process of its own; and its notes, which the program tells."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", CospeechWarning)
        try:
            _check_stop()
            found: Report | Failure = _generate_one(job, options, model=model, progress=_check_stop)
        except CospeechError as error:
            found = Failure(speech=str(job.speech), error=str(error), ours=isinstance(error, InternalError))
    return found, [str(warning.message) for warning in told if issubclass(warning.category, CospeechWarning)]


@contextmanager
def _tell_paths(speech: Path) -> Iterator[None]:
    """Notes that name a speech tell its path: many folders have a ``line1.wav``."""
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
    """One of several speeches."""
    with _tell_paths(job.speech):
        return replace(_generate(job, options, **more), speech=str(job.speech))


def _generate(job: _Job, options: Mapping[str, Any], **more: Any) -> Report:
    with make_folders(job.folders):
        return generate_files(job.speech, job.outputs, **{**options, **job.own, **more})


@contextmanager
def _find_speeches(given: Sequence[str | PathLike[str]]) -> Iterator[FoundFiles]:
    """Yield what `find_files` finds, or standard input.

    Raises:
        InputError: as of `find_files`, or standard input is not alone, closed or too large.
    """
    if [os.fspath(speech) for speech in given] == [STANDARD_INPUT]:
        with _read_standard_input() as path:
            yield FoundFiles({path.name: path}, {})
        return
    for speech in given:
        if os.fspath(speech) == STANDARD_INPUT:
            raise InputError("standard input (-) is named together with other speeches", "name it alone")
        if "://" in os.fspath(speech):  # of an address, a `Path` would lose a slash
            regular_file(speech)
    from ..corpora.folder import SOUND

    yield find_files(map(Path, given), _list_sounds, "sound", SOUND)


def _list_sounds(folder: Path, left_out: LeftOut) -> list[tuple[str, Path]]:
    """Sound files of a folder, but no video beside a sound of its name: it may be the recording, or a film that we made."""
    from ..corpora.clip import Dropped
    from ..corpora.folder import VIDEO, sounds
    from ..export.mp4 import is_own_film

    dropped: list[Dropped] = []
    found = list(sounds(folder, dropped))
    heard = {name for name, each in found if each.suffix.lower() not in VIDEO}
    videos = [each for name, each in found if name in heard and each.suffix.lower() in VIDEO]
    left_out |= dict.fromkeys((each for each in videos if not is_own_film(each)), "a sound of the same name is beside it")
    left_out |= {folder / item.name: item.reason for item in dropped}
    skipped = {*videos, *left_out}
    return [(name, each) for name, each in found if each not in skipped]


@contextmanager
def _read_standard_input() -> Iterator[Path]:
    """Yield a file with what standard input has.

    Raises:
        InputError: it is a terminal, empty, or larger than `PIPED_BYTES`.
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


def _job(name: str, speech: Path, given: Sequence[str], options: Mapping[str, Any], shown: set[str], *, several: bool) -> _Job:
    """What to make of a speech.

    Args:
        name, speech: its name and file.
        given: the outputs as they were named.
        options: of `generate_files`.
        shown: the parts that move.
        several: whether there are other speeches.

    Raises:
        InputError: a file that would be that of several speeches.
    """
    if not given and name == "stdin":
        raise InputError("no file to write for standard input", f"-o FILE, with a suffix of {' '.join(FORMATS)}")
    usual = [suffix for suffix in _USUAL if shown & {*FORMATS[suffix].holds}] or _USUAL
    outputs: list[Path] = []
    folders: set[Path] = set()
    for text in given or ["."]:
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
    put_in = {key: put_name(str(options[key]), name) for key in _WITH_NAME if NAME in str(options.get(key))}
    if "plan_out" in put_in:
        put_in["plan_out"] = str(options["plan_out"]).replace(NAME, name)
        folders.add(Path(put_in["plan_out"]).parent)
    return _Job(speech, name, outputs, folders, put_in)


def _check_new(jobs: list[_Job], options: Mapping[str, Any]) -> None:
    """Files that nobody named are written over none: a recording of that name may lie beside its sound."""
    takes = int(options.get("takes", 1))
    there = [path for job in jobs for path in _takes(job, takes) if path.exists()]
    if there:
        are = f" and {len(there) - 1} more are" if len(there) > 1 else " is"
        hint = f"-o {there[0]} writes over it" if len(there) == 1 else "-o ./ writes over them"
        raise InputError(f"{str(there[0])!r}{are} there already", f"{hint}; -o out/ writes to another folder")


def _check_left_out(
    jobs: list[_Job], options: Mapping[str, Any], report: str | PathLike[str] | None, left_out: LeftOut
) -> None:
    """Nothing is written over a file that was left out beside the speeches: it may be the recording of one of them."""
    takes = int(options.get("takes", 1))
    plans = [job.own.get("plan_out", options.get("plan_out")) for job in jobs]
    others = [Path(path) for path in (*plans, report) if path is not None]
    check_apart([*(path for job in jobs for path in _takes(job, takes)), *others], [*left_out])


def _takes(job: _Job, takes: int) -> list[Path]:
    return [take_path(path, take, takes) for take in range(1, takes + 1) for path in job.outputs]


def _list_undone(jobs: list[_Job], options: Mapping[str, Any]) -> list[_Job]:
    """Those of which a file is missing, or older than the speech or what is read for it alone; a note tells of the rest."""
    left = [job for job in jobs if not _is_done(job, options)]
    if len(left) < len(jobs):
        made = f"{len(jobs) - len(left)} of {say_count(len(jobs), 'speech', 'speeches')} left out: their files are there"
        warnings.warn(f"{made} (--resume)", CospeechWarning, stacklevel=3)
    return left


def _is_done(job: _Job, options: Mapping[str, Any]) -> bool:
    given = {key: job.own.get(key, options.get(key)) for key in _OF_ONE_SPEECH}
    own = {key: Path(value) for key, value in given.items() if isinstance(value, str | PathLike)}
    written = [*_takes(job, int(options.get("takes", 1))), *([own.pop("plan_out")] if "plan_out" in own else [])]
    if not all(path.is_file() for path in written):
        return False
    read = [path.stat().st_mtime for path in (job.speech, *own.values()) if path.exists()]
    return max(read) <= min(path.stat().st_mtime for path in written)


def _is_folder(text: str) -> bool:
    """Whether a name of an output means a folder; one called ``x.bvh`` is nothing but in the way."""
    return text.endswith(("/", os.sep)) or (Path(text).suffix.lower() not in FORMATS and Path(text).is_dir())


def _check(jobs: list[_Job], options: Mapping[str, Any], report: str | PathLike[str] | None) -> None:
    """All files of all speeches can be told apart."""
    takes = int(options.get("takes", 1))
    names = [path for job in jobs for path in _takes(job, takes)]
    first, *speeches = (job.speech for job in jobs)
    read = [Path(job.own[key]) for job in jobs for key in _WITH_NAME if key in job.own]
    shared = [options.get(key) for key in _OF_ALL if key not in jobs[0].own]
    read += [Path(path) for path in (*shared, *example_files(options.get("style"))) if isinstance(path, str | PathLike)]
    if report is not None and NAME in str(report):
        raise InputError(f"a report of each speech, {str(report)!r}", "one file holds the reports of all: --report report.json")
    check_files(first, names, [*speeches, *read], None if report is None else Path(report))
