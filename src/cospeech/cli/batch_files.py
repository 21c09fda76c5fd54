"""The files of ``cospeech generate`` for several speeches: which are written for each, and checks before the work begins."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import CospeechWarning, InputError, say_count
from ..export import FORMATS
from ..export.checks import check_apart, check_files
from ..generate import take_path
from ..runtime.styles.style import example_files
from .several import NAME, LeftOut, put_name

__all__ = ["Job", "check_files_of_jobs", "check_left_out", "check_new", "list_undone", "make_job"]

_USUAL = (".bvh", ".glb")  # formats that are written where none is named
_OF_ONE_SPEECH = {
    "transcript": f"words/{NAME}.srt", "face": f"faces/{NAME}.csv", "plan": f"plans/{NAME}.json",
    "plan_out": f"plans/{NAME}.json", "keep_from": f"old/{NAME}.npz",
}  # fmt: skip
"""Options that need a value of its own for each speech → an example, for the hint."""
_WITH_NAME = (*_OF_ONE_SPEECH, "emotion", "continue_from")  # options whose value may have `NAME` in it
_OF_ALL = ("emotion", "continue_from", "bone_map", "skeleton", "avatar")
"""Options that may name a file which all speeches share."""


class Job(NamedTuple):
    """A speech, and the files to make of it."""

    speech: Path
    name: str
    outputs: list[Path]
    folders: set[Path]
    """Folders that are made if they are missing."""
    own: dict[str, Any]
    """Options of this speech alone."""


def make_job(
    name: str, speech: Path, targets: Sequence[str], options: Mapping[str, Any], parts: set[str], *, several: bool
) -> Job:
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
    return Job(speech, name, outputs, folders, own_options)


def check_new(jobs: list[Job], options: Mapping[str, Any]) -> None:
    """Raise an InputError if an output that the user did not name exists: it may be the recording of a speech."""
    takes = int(options.get("takes", 1))
    existing = [path for job in jobs for path in _takes(job, takes) if path.exists()]
    if existing:
        are = f" and {len(existing) - 1} more are" if len(existing) > 1 else " is"
        hint = f"-o {existing[0]} writes over it" if len(existing) == 1 else "-o ./ writes over them"
        raise InputError(f"{str(existing[0])!r}{are} there already", f"{hint}; -o out/ writes to another folder")


def check_left_out(jobs: list[Job], options: Mapping[str, Any], report: str | PathLike[str] | None, left_out: LeftOut) -> None:
    """Raise an InputError if an output is a file that was left out beside the speeches: it may be a recording."""
    takes = int(options.get("takes", 1))
    plans = [job.own.get("plan_out", options.get("plan_out")) for job in jobs]
    others = [Path(path) for path in (*plans, report) if path is not None]
    check_apart([*(path for job in jobs for path in _takes(job, takes)), *others], [*left_out])


def _takes(job: Job, takes: int) -> list[Path]:
    return [take_path(path, take, takes) for take in range(1, takes + 1) for path in job.outputs]


def list_undone(jobs: list[Job], options: Mapping[str, Any]) -> list[Job]:
    """Jobs with an output that is missing, or older than the speech or a file of its own options; a note counts the others."""
    remaining = [job for job in jobs if not _is_done(job, options)]
    if len(remaining) < len(jobs):
        text = f"{len(jobs) - len(remaining)} of {say_count(len(jobs), 'speech', 'speeches')} left out: their files are there"
        warnings.warn(f"{text} (--resume)", CospeechWarning, stacklevel=3)
    return remaining


def _is_done(job: Job, options: Mapping[str, Any]) -> bool:
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


def check_files_of_jobs(jobs: list[Job], options: Mapping[str, Any], report: str | PathLike[str] | None) -> None:
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
