"""``cospeech prepare`` and ``cospeech synthesise``: the commands that make stores and synthetic corpora. As light as `cli`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

__all__ = ["register"]

Tell = Callable[[float, float | None], None]
Progress = Callable[[str, bool], AbstractContextManager[Tell | None]]
Corpus = Annotated[str, Argument(metavar="CORPUS", help="See `cospeech list corpora`.")]
Raw = Annotated[Path, Argument(metavar="RAW", help="Folder of the corpus, as it unpacks.")]
Store = Annotated[Path, Argument(metavar="STORE", help="Folder to make.")]
New = Annotated[Path, Argument(metavar="RAW", help="Folder to make.")]
Pose = Annotated[str | None, Option("--pose", metavar="NAME", help="Pose representation; that of the corpus's papers else.")]
Rate = Annotated[float | None, Option("--fps", metavar="NUMBER", help="Frames per second; those of the papers else.")]
Filters = Annotated[bool, Option("--filters/--no-filters", help="Leave out what the papers do: static, bent, still.")]
Mirror = Annotated[bool, Option("--mirror", help="Add training clips with left and right exchanged.")]
Speeds = Annotated[
    list[float] | None, Option("--speed", metavar="NUMBER", help="Add training clips this much faster, 0.5 … 2.")
]
Pitches = Annotated[
    list[float] | None, Option("--pitch", metavar="NUMBER", help="Add training clips this many semitones higher.")
]
DerivedSpeakers = Annotated[
    list[str] | None,
    Option("--derive-speaker", metavar="NAME", help="Add speakers: leftarm, rightarm, mirror; of one speaker: 'cleo|leftarm'."),
]
Twin = Annotated[list[str] | None, Option("--twin", hidden=True)]  # old name
"""What 0.1.0 called ``--derive-speaker``: an error says the new name."""
Jobs = Annotated[int, Option("--jobs", "-j", metavar="NUMBER", help="Workers; -1: one per core.")]
Backend = Annotated[
    str, Option("--backend", metavar="NAME", help="Joblib's: loky, threading, multiprocessing, or a cluster's: dask, ray.")
]
Scheduler = Annotated[str | None, Option("--scheduler", metavar="ADDRESS", help="Of a Dask cluster: tcp://head:8786.")]
Encoder = Annotated[
    str | None, Option("--wav2vec", metavar="NAME", help="Keep what a wav2vec 2.0 hears too: its folder, or name on the hub.")
]
Overwrite = Annotated[bool, Option("--overwrite", help="Replace a store that is there.")]
Layout = Annotated[str, Option("--layout", metavar="NAME", help="ted, trinity, pats or beat.")]
Speech = Annotated[Path | None, Option("--speech", metavar="FOLDER", help="Recordings to gesture to, with words beside them.")]
Hours = Annotated[float, Option("--hours", metavar="NUMBER", help="How much motion to make.")]
Speakers = Annotated[int | None, Option("--speakers", metavar="NUMBER", help="How many; 8, Trinity 1 else.")]
Seed = Annotated[int, Option("--seed", metavar="NUMBER", help="Another seed, another corpus.")]
Tts = Annotated[bool, Option("--tts/--no-tts", help="Whether espeak-ng and flite speak, where they are installed.")]
Act = Annotated[bool, Option("--act/--no-act", help="Whether voices act the emotions (BEAT's layout).")]
Quiet = Annotated[bool, Option("--quiet", "-q", help="No progress bar, no summary.")]
Debug = Annotated[bool, Option("--debug", help="Show the traceback of an error.")]


def register(app: typer.Typer, progress: Progress) -> None:
    """Add both commands.

    Args:
        app: of the command line.
        progress: from a title and whether to be quiet to a context with a function that is told what is done.
    """
    _add_prepare(app, progress)
    _add_synthesise(app, progress)


def _add_prepare(app: typer.Typer, progress: Progress) -> None:
    @app.command()
    def prepare(
        corpus: Corpus,
        raw: Raw,
        store: Store,
        pose: Pose = None,
        fps: Rate = None,
        filters: Filters = True,
        mirror: Mirror = False,
        speed: Speeds = None,
        pitch: Pitches = None,
        derivation: DerivedSpeakers = None,
        twin: Twin = None,  # old name
        jobs: Jobs = 1,
        backend: Backend = "loky",
        scheduler: Scheduler = None,
        wav2vec: Encoder = None,
        overwrite: Overwrite = False,
        quiet: Quiet = False,
        debug: Debug = False,
    ) -> None:
        """Make a store, which training reads, of a corpus.

        The corpus stays as it lies on disk. Stopped half-way, the same command goes on where it was.

        \b
        cospeech prepare beat beat_english_v0.2.1 stores/beat --jobs -1
        """
        from ..corpora.prepare import prepare as make

        if twin:  # old name
            from ..errors import InputError

            hint = f"it is called --derive-speaker now: --derive-speaker {twin[0]}"  # old name
            raise InputError("there is no option --twin", hint)  # old name

        with progress("preparing", quiet) as tell:
            report = make(
                corpus, raw, store, pose=pose, fps=fps, filters=filters, mirror=mirror, speeds=speed or (), pitches=pitch or (),
                derived_speakers=derivation or (), jobs=jobs, backend=backend, scheduler=scheduler, wav2vec=wav2vec,
                overwrite=overwrite, progress=tell,
            )  # fmt: skip
        if not quiet:
            typer.echo(f"{store}  {report.summary()}")
            for reason, seconds in sorted(report.reasons.items(), key=lambda row: -row[1]):
                typer.echo(f"  {seconds:8.1f} s  {reason}")
            whole = [row for row in report.dropped if "start" not in row]
            for row in whole[:5]:
                typer.echo(f"  {row['name']}: {row['reason']}")
            if len(whole) > 5:
                typer.echo(f"  and {len(whole) - 5} more: {store / 'report.json'}")


def _add_synthesise(app: typer.Typer, progress: Progress) -> None:
    @app.command()
    def synthesise(
        raw: New,
        layout: Layout = "beat",
        speech: Speech = None,
        hours: Hours = 0.5,
        speakers: Speakers = None,
        seed: Seed = 0,
        tts: Tts = True,
        act: Act = True,
        quiet: Quiet = False,
        debug: Debug = False,
    ) -> None:
        """Make a synthetic corpus: to test, to teach, to practise.

        The rule-based gesturer performs recordings or synthetic voices; the files lie as those of a real corpus do.

        \b
        cospeech synthesise raw/beat --layout beat --speech recordings --hours 2
        """
        from ..corpora.synthetic import synthesise as make

        with progress("synthesising", quiet) as tell:
            report = make(
                raw, layout, speech=speech, hours=hours, speakers=speakers, seed=seed, tts=tts, act=act, progress=tell
            )
        if not quiet:
            typer.echo(f"{raw}  {report.summary()}")
