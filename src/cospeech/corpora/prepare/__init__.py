"""``cospeech prepare``: a corpus as it lies on disk → a store that trains at full speed.

Clip by clip: the corpus's reader → augmentation → poses and features at one rate → the papers' filters → a part on disk. When
all are there they are put together (`cospeech.corpora.store`). Stopped half-way and started again, it makes only the parts that
are missing, and the store has the same bytes. Parts are made by joblib's workers, on this machine or, with the backends of Dask
and Ray, on a cluster that sees the same folder.
"""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from itertools import count
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from ...audio.features.waveform import WAVEFORM_NAMES
from ...errors import CospeechError, InputError, describe_extra, find_attribute, nearest
from ...files import atomic, describe_os_error
from ...motion.poses import POSES, find_pose
from ...motion.skeletons.arkit import ARKIT
from .. import CORPORA
from ..attributes import speaker_attributes
from ..augment import faster, mirror_clip, shift_pitch
from ..clip import Clip, Dropped
from ..shared_speech import measure_shared_speech
from ..store import Store
from ..store_files import FORMAT
from ..store_writer import write_store
from .derive_speakers import Change, plan_derivations
from .filters import FILTERS
from .pieces import PreparationPlan, audio_names, make_part, read_part, select_extra, split_of, wav2vec_names
from .report import PrepareReport, describe_reasons, join_notes

__all__ = ["DEFAULT_POSES", "FILTERS", "PrepareReport", "prepare"]

DEFAULT_POSES = {
    "ted": "direction-vectors", "trinity": "expmap-upper", "pats": "keypoints2d", "beat": "euler", "beat2": "rot6d-smplx",
    "zeroeggs": "rot6d-humanoid", "faces": "face", "folder": "rot6d-humanoid",
}  # fmt: skip
"""Corpus → the pose representation of its papers; six numbers per joint where papers have no custom."""

_AHEAD = 4  # ours: clips read ahead per worker; bounds the memory


@join_notes()
def prepare(
    corpus: str,
    raw: str | PathLike[str],
    store: str | PathLike[str],
    *,
    pose: str | None = None,
    fps: float | None = None,
    filters: bool = True,
    mirror: bool = False,
    speeds: Sequence[float] = (),
    pitches: Sequence[float] = (),
    derived_speakers: Sequence[str] = (),
    jobs: int = 1,
    backend: str = "loky",
    scheduler: str | None = None,
    wav2vec: str | None = None,
    waveform: bool = False,
    overwrite: bool = False,
    progress: Callable[[float, float | None], None] | None = None,
) -> PrepareReport:
    """Make a store of a corpus.

    Args:
        corpus: a name of `CORPORA`.
        raw: its folder, as it unpacks.
        store: the folder to be; not within ``raw``.
        pose: a name of `cospeech.motion.poses.POSES`; that of the corpus's papers where not given.
        fps: frames per second; those of the representation where not given.
        filters: leave out what the papers do (`FILTERS`).
        mirror: add every training clip with left and right exchanged.
        speeds: add training clips so many times as fast, 0.5 … 2.
        pitches: add training clips with the voice so many semitones higher (−12 … 12).
        derived_speakers: add further speakers, in every split: a name of `cospeech.corpora.derived_speakers.DERIVATIONS`
            makes one of every speaker, ``"cleo|leftarm"`` one of cleo. The corpus is then read twice.
        jobs: workers; 1 does everything in this process and needs no joblib; −1: one per core.
        backend: joblib's name: loky, threading, multiprocessing, dask, ray.
        scheduler: of a Dask cluster, such as ``"tcp://head:8786"``; without it the client that the caller has made.
        wav2vec: folder or name of a wav2vec 2.0, whose CNN's features are kept in the store too; needs PyTorch.
        waveform: keep the samples of the speech in the store too; 117 MB an hour at 15 frames a second.
        overwrite: replace a store that is there already.
        progress: called with seconds of motion done, and None (how much there will be is not known).

    Returns:
        The report; it is also in ``report.json``.

    Raises:
        InputError: an unknown name, an option out of range, a folder that cannot be read or written, a store within ``raw``, or
            nothing left.
    """
    if corpus not in CORPORA:
        raise InputError(f"no corpus is called {corpus!r}", nearest(corpus, CORPORA))
    target = Path(store)
    _check_target(target, Path(raw), overwrite)
    if not pose and corpus not in DEFAULT_POSES:
        raise InputError(f"no pose representation is set for {corpus!r}", f"--pose chooses one: {', '.join(POSES)}")
    representation = find_pose(pose or DEFAULT_POSES[corpus])
    rate = representation.fps if fps is None else fps
    if not 1 <= rate <= 240:
        raise InputError(f"{rate} frames per second", "1 … 240")
    for what, values, low, high in (("a speed", speeds, 0.5, 2), ("a pitch", pitches, -12, 12)):
        if wrong := [value for value in values if not low <= value <= high]:
            raise InputError(f"{what} of {wrong[0]:g}", f"{low:g} … {high:g}{' semitones' if what == 'a pitch' else ''}")
    if jobs == 0 or jobs < -1:
        raise InputError(f"{jobs} jobs", "a positive number, or -1 for one per core")
    if scheduler is not None and backend != "dask":
        raise InputError(f"a scheduler {scheduler!r} for the backend {backend!r}", "it is for --backend dask")
    if wav2vec is not None:
        wav2vec_names(wav2vec)  # so that an error comes now, and not once per clip
    read = _find_reader(corpus)
    derivations_for = plan_derivations(derived_speakers, lambda: read(raw), mirror)
    plan = PreparationPlan(corpus, representation.name, float(rate), filters, wav2vec, waveform)
    settings = {"mirror": mirror, "speeds": [*speeds], "pitches": [*pitches], "derived_speakers": [*derived_speakers]}
    drops: list[dict[str, Any]] = []
    with _parts_folder(target, {"plan": asdict(plan)} | settings) as parts:
        tasks = _tasks(read(raw), derivations_for, _changes(mirror, speeds, pitches), parts, drops)
        with _workers(jobs, backend, scheduler) as (run, together):
            outcomes = _make_parts(tasks, plan, run, together, progress)
        return _assemble(target, outcomes, plan, drops)


def _find_reader(corpus: str) -> Callable[[str | PathLike[str]], Iterator[Clip | Dropped]]:
    """The function that reads a corpus.

    Raises:
        InputError: its module is not there, or has none.
    """
    module = CORPORA[corpus].module
    read: Callable[[str | PathLike[str]], Iterator[Clip | Dropped]] = find_attribute(
        module, "read", f"the corpus {corpus!r} cannot be read", f"its row says that {module} has read"
    )
    return read


def _check_target(target: Path, raw: Path, overwrite: bool) -> None:
    """The store gets a folder of its own.

    Raises:
        InputError: the folder is one of recordings, or within the corpus, where its files would be read as takes, or holds a
            store already.
    """
    folder, source = target.resolve(), raw.resolve()
    recordings = (*target.glob("*.bvh"), *target.glob("*.wav"), *target.glob("*.flac"))
    if source == folder or recordings:
        raise InputError(f"there are recordings in {str(target)!r}, where the store shall be", "give it a folder of its own")
    if source in folder.parents:
        problem = f"the store {str(target)!r} would lie in the folder of the corpus {str(raw)!r}"
        raise InputError(problem, "name a folder outside it, such as stores/NAME")
    if (target / "index.json").exists() and not overwrite:
        raise InputError(f"there is a store in {str(target)!r} already", "--overwrite replaces it")


def _changes(mirror: bool, speeds: Sequence[float], pitches: Sequence[float]) -> list[Change]:
    """The augmentations that were asked for."""
    changes: list[Change] = [mirror_clip] if mirror else []
    changes += [lambda clip, s=speed: faster(clip, s) for speed in speeds if speed != 1]  # type: ignore[misc]
    return changes + [lambda clip, p=pitch: shift_pitch(clip, p) for pitch in pitches if pitch != 0]  # type: ignore[misc]


class _NothingLeft(InputError):
    """Everything was read, and nothing of it can be in a store."""


@contextmanager
def _parts_folder(target: Path, settings: dict[str, Any]) -> Iterator[Path]:
    """Yield the folder of the parts, empty unless it was begun with the same settings.

    It stays if there are parts for the next run to go on with. Else it is removed, with the folders that were made for it.
    """
    missing = [folder for folder in (target, *target.parents) if not folder.exists()]
    parts, keep = _begin_parts(target, settings), False
    try:
        yield parts
    except _NothingLeft:
        raise
    except BaseException:
        keep = next(parts.glob("*.npz"), None) is not None
        raise
    finally:
        if not keep:
            shutil.rmtree(parts, ignore_errors=True)
        for folder in missing:
            with suppress(OSError):  # it holds something
                folder.rmdir()


def _begin_parts(target: Path, settings: dict[str, Any]) -> Path:
    """Make the folder of the parts.

    Raises:
        InputError: it cannot be made.
    """
    parts = target / ".parts"
    text = json.dumps({"format": FORMAT} | settings, sort_keys=True)
    note = parts / "settings.json"
    try:
        if parts.is_dir() and not (note.is_file() and note.read_text("utf-8") == text):
            shutil.rmtree(parts)
        parts.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot write to {str(target)!r}: {describe_os_error(error)}") from None
    with atomic(note) as temporary:
        temporary.write_text(text, "utf-8", newline="\n")
    return parts


class _Task(NamedTuple):
    """A clip, the path of its part, and where it comes from: read, derived speaker or augmented."""

    clip: Clip
    path: Path
    origin: str


def _tasks(
    items: Iterable[Clip | Dropped],
    derivations_for: Callable[[Clip], list[Change]],
    changes: list[Change],
    parts: Path,
    drops: list[dict[str, Any]],
) -> Iterator[_Task]:
    """Every clip, those of its derived speakers, and augmented training clips; drops go into the list."""
    number, names = count(), set()
    if not isinstance(items, Iterable):
        raise InputError(f"the reader of the corpus gives {type(items).__name__}", "it yields Clip and Dropped")
    for item in items:
        if not isinstance(item, Clip | Dropped):
            raise InputError(f"the reader of the corpus yields {type(item).__name__}", "it yields Clip and Dropped")
        if isinstance(item, Dropped):
            drops.append({"name": item.name, "reason": item.reason})
            continue
        if item.name in names:
            drops.append({"name": item.name, "reason": "a clip of this name was read already"})
            continue
        names.add(item.name)
        clip = replace(item, split=split_of(item), extra=select_extra(item))
        derived_speakers = _apply_changes(clip, derivations_for(clip), "no derived speaker", drops)
        for one, origin in ((clip, "read"), *((derivation, "derived") for derivation in derived_speakers)):
            yield _Task(one, parts / f"{next(number):07d}.npz", origin)
            for other in _apply_changes(one, changes, "not augmented", drops) if one.split == "train" else ():
                yield _Task(other, parts / f"{next(number):07d}.npz", "augmented")


def _apply_changes(clip: Clip, changes: list[Change], problem: str, drops: list[dict[str, Any]]) -> Iterator[Clip]:
    """What each change makes of a clip; what fails goes into the list."""
    for change in changes:
        try:
            yield change(clip)
        except CospeechError as error:
            drops.append({"name": clip.name, "reason": f"{problem}: {error}"})


def _make_parts(
    tasks: Iterator[_Task],
    plan: PreparationPlan,
    run: Callable[[list[tuple[Clip, PreparationPlan, Path]]], list[dict[str, Any]]],
    together: int,
    progress: Callable[[float, float | None], None] | None,
) -> list[tuple[Path, dict[str, Any], str]]:
    """Make the parts, some clips at a time: the reader runs here, joblib's workers encode."""
    outcomes: list[tuple[Path, dict[str, Any], str]] = []
    seconds, more = 0.0, True
    while more:
        batch: list[_Task] = []
        while len(batch) < together and (task := next(tasks, None)) is not None:
            batch.append(task)
        more = len(batch) == together
        results = run([(task.clip, plan, task.path) for task in batch])
        outcomes += [(task.path, meta, task.origin) for task, meta in zip(batch, results, strict=True)]
        seconds += sum(meta["frames"] for meta in results) / plan.fps
        if progress is not None:
            progress(seconds, None)
    return outcomes


@contextmanager
def _workers(
    jobs: int, backend: str, scheduler: str | None
) -> Iterator[tuple[Callable[[list[tuple[Clip, PreparationPlan, Path]]], list[dict[str, Any]]], int]]:
    """Yield a function that makes parts in parallel, and how many clips it is best given at once."""
    if jobs == 1 and backend == "loky":
        yield lambda tasks: [make_part(*task) for task in tasks], 1
        return
    try:
        from joblib import Parallel, delayed, effective_n_jobs, parallel_config
    except ImportError:
        raise InputError("several jobs need joblib", describe_extra("corpora")) from None
    client = None
    try:
        client = _connect(backend, scheduler)
        with parallel_config(backend, n_jobs=jobs), Parallel() as parallel:
            together = _AHEAD * max(1, effective_n_jobs(jobs))
            yield lambda tasks: list(parallel(delayed(make_part)(*task) for task in tasks)), together
    except ValueError as error:  # joblib's words for an unknown backend, or a Dask that has no client
        if isinstance(error, CospeechError):
            raise
        raise InputError(f"the backend {backend!r} cannot be used: {error}"[:240].replace("\n", " ")) from None
    finally:
        if client is not None:
            client.close()


def _connect(backend: str, scheduler: str | None) -> Any:
    """The client of the Dask cluster that was named; for Ray, its backend is registered and there is no client."""
    try:
        if backend == "ray":
            from ray.util.joblib import register_ray

            register_ray()
        if backend == "dask":
            from distributed import Client

            return Client(scheduler, timeout="20s") if scheduler else None
    except ImportError:
        hint = "pip install distributed" if backend == "dask" else 'pip install "ray[default]"'
        raise InputError(f"the backend {backend!r} is not installed", hint) from None
    except OSError as error:
        raise InputError(f"no Dask scheduler answers at {scheduler!r}: {error}"[:200], "such as tcp://head:8786") from None
    return None


def _assemble(
    target: Path, outcomes: list[tuple[Path, dict[str, Any], str]], plan: PreparationPlan, drops: list[dict[str, Any]]
) -> PrepareReport:
    """Put the parts together and write the report."""
    pieces = []
    reasons: dict[str, float] = {}
    cut: dict[str, float] = {}
    for path, meta, _ in outcomes:
        pieces += read_part(path, meta, plan.fps)
        if meta["why"] is not None:
            drops.append({"name": meta["name"], "reason": meta["why"]})
        for first, end, reason in meta["losses"]:
            seconds = (end - first) / plan.fps
            reasons[reason] = reasons.get(reason, 0.0) + seconds
            drops.append({"name": meta["name"], "reason": reason, "start": first / plan.fps, "end": end / plan.fps})
        for start, end, reason in meta["cut"]:
            cut[reason] = cut.get(reason, 0.0) + end - start
            drops.append({"name": meta["name"], "reason": reason, "start": start, "end": end})
    if not pieces:
        raise _NothingLeft(f"nothing of this {plan.corpus} corpus is left for a store", describe_reasons(drops))
    names = {"pose": find_pose(plan.pose).names, "audio": audio_names(plan.corpus), "face": ARKIT}
    if plan.wav2vec is not None:
        names["wav2vec"] = wav2vec_names(plan.wav2vec)
    if plan.waveform:
        names["waveform"] = WAVEFORM_NAMES
    write_store(target, pieces, corpus=plan.corpus, pose=plan.pose, fps=plan.fps, names=names)
    splits: dict[str, float] = {}
    speakers: dict[str, float] = {}
    for piece in pieces:
        seconds = piece.entry.frames / plan.fps
        splits[piece.entry.split] = splits.get(piece.entry.split, 0.0) + seconds
        speakers[piece.entry.speaker] = speakers.get(piece.entry.speaker, 0.0) + seconds
    origins = Counter(origin for _, meta, origin in outcomes if meta["why"] is None)
    store = Store(target)
    report = PrepareReport(
        plan.corpus, plan.pose, plan.fps, origins["read"], origins["augmented"], sum(splits.values()), splits, speakers,
        reasons, tuple(drops), origins["derived"], speaker_attributes(store, find_pose(plan.pose).decode), cut,
        measure_shared_speech(store),
    )  # fmt: skip
    with atomic(target / "report.json") as temporary:
        temporary.write_text(json.dumps(asdict(report), indent=1, ensure_ascii=False), "utf-8", newline="\n")
    return report
