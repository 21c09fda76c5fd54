"""``cospeech prepare`` and ``cospeech synthesise``: stores and synthetic corpora. Imports are late, as in `cli.main`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from .options import Debug
from .progress import show_progress

__all__ = ["register"]

Corpus = Annotated[str, Argument(metavar="CORPUS", help="A name that `cospeech list corpora` prints.")]
Raw = Annotated[Path, Argument(metavar="RAW", help="Folder of the corpus, as its authors publish it.")]
Store = Annotated[Path, Argument(metavar="STORE", help="Folder of the new store, outside RAW.")]
New = Annotated[Path, Argument(metavar="RAW", help="Folder of the new corpus.")]
Pose = Annotated[
    str | None, Option("--pose", metavar="NAME", help="Pose representation. The default is that of the corpus's papers.")
]
Rate = Annotated[
    float | None, Option("--fps", metavar="NUMBER", help="Frames per second. The default is that of the corpus's papers.")
]
Filters = Annotated[
    bool, Option("--filters/--no-filters", help="Leave out the clips that the papers leave out: static or bent poses.")
]
Mirror = Annotated[bool, Option("--mirror", help="Add training clips with left and right exchanged.")]
Speeds = Annotated[
    list[float] | None, Option("--speed", metavar="NUMBER", help="Add training clips that are faster by this factor, 0.5 … 2.")
]
Pitches = Annotated[
    list[float] | None,
    Option("--pitch", metavar="NUMBER", help="Add training clips with the voice higher by this many semitones."),
]
DerivedSpeakers = Annotated[
    list[str] | None,
    Option(
        "--derive-speaker",
        metavar="NAME",
        help="Add derived speakers: leftarm, rightarm, mirror; from one speaker: 'cleo|leftarm'.",
    ),
]
Twin = Annotated[list[str] | None, Option("--twin", hidden=True)]  # old name
"""The name of ``--derive-speaker`` in 0.1.0: an error tells the new name."""
Jobs = Annotated[int, Option("--jobs", "-j", metavar="NUMBER", help="Number of workers. -1: one per core.")]
Backend = Annotated[
    str, Option("--backend", metavar="NAME", help="Backend of joblib: loky, threading, multiprocessing, dask, ray.")
]
Scheduler = Annotated[str | None, Option("--scheduler", metavar="ADDRESS", help="Address of a Dask cluster: tcp://head:8786.")]
Encoder = Annotated[
    str | None,
    Option("--wav2vec", metavar="NAME", help="Also store the features of a wav2vec 2.0: its folder, or its name on the hub."),
]
Waveform = Annotated[
    bool, Option("--waveform", help="Also store the samples of the speech, which the trimodal and joint-embedding models need.")
]
Overwrite = Annotated[bool, Option("--overwrite", help="Replace a store that exists.")]
Layout = Annotated[str, Option("--layout", metavar="NAME", help="File layout: ted, trinity, pats or beat.")]
Speech = Annotated[
    Path | None, Option("--speech", metavar="FOLDER", help="Folder of recordings to use, with transcripts beside them.")
]
Hours = Annotated[float, Option("--hours", metavar="NUMBER", help="Hours of motion to make.")]
Speakers = Annotated[
    int | None, Option("--speakers", metavar="NUMBER", help="Number of speakers. The default is 8; Trinity has 1.")
]
Seed = Annotated[int, Option("--seed", metavar="NUMBER", help="Seed. Another seed gives another corpus.")]
Gestures = Annotated[
    int,
    Option(
        "--gestures",
        metavar="NUMBER",
        min=0,
        help="Seed of the motion alone. Another one gives the same speech and other motion.",
    ),
]
Tts = Annotated[bool, Option("--tts/--no-tts", help="Also use the speech programs espeak-ng and flite, if they are installed.")]
Act = Annotated[bool, Option("--act/--no-act", help="Change the voices so that the emotions can be heard.")]
Calm = Annotated[bool, Option("--neutral", help="Make all takes neutral.")]
Coupling = Annotated[
    float | None,
    Option(
        "--coupling",
        metavar="NUMBER",
        help="How often brows, nods and blinks come with strokes, 0 … 1. The default is that of the styles.",
    ),
]
Variation = Annotated[
    float,
    Option(
        "--variation",
        metavar="NUMBER",
        help="How much tempo, amplitude and preferred hand vary from take to take, 0 … 2. It is not audible.",
    ),
]
Silence = Annotated[
    float,
    Option(
        "--silence",
        metavar="SHARE",
        help="How much of a take is silence that is put into the speech, 0 … 0.8. The hands rest there.",
    ),
]
Quiet = Annotated[bool, Option("--quiet", "-q", help="Print no progress bar and no summary.")]


def register(app: typer.Typer) -> None:
    """Add both commands to the program."""
    _add_prepare(app)
    _add_synthesise(app)


def _add_prepare(app: typer.Typer) -> None:
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
        waveform: Waveform = False,
        overwrite: Overwrite = False,
        quiet: Quiet = False,
        debug: Debug = False,
    ) -> None:
        """Prepare a corpus for training: read it and write a store.

        The corpus does not change. If the command is stopped, run it again: it encodes only what is missing.

        \b
        cospeech prepare beat beat_english_v0.2.1 stores/beat --jobs -1
        cospeech prepare folder my_takes stores/mine --pose expmap-humanoid --fps 12
        """
        from ..corpora.prepare import prepare as make

        if twin:  # old name
            from ..errors import InputError

            hint = f"it is called --derive-speaker now: --derive-speaker {twin[0]}"  # old name
            raise InputError("there is no option --twin", hint)  # old name

        try:
            with show_progress("preparing", quiet) as tell:
                report = make(
                    corpus, raw, store, pose=pose, fps=fps, filters=filters, mirror=mirror, speeds=speed or (),
                    pitches=pitch or (), derived_speakers=derivation or (), jobs=jobs, backend=backend, scheduler=scheduler,
                    wav2vec=wav2vec, waveform=waveform, overwrite=overwrite, progress=tell,
                )  # fmt: skip
        except (KeyboardInterrupt, SystemExit):  # SystemExit: SIGTERM
            typer.echo("run the same command again to go on", err=True)
            raise
        if not quiet:
            typer.echo(f"{store}  {report.summary()}")
            for reason, seconds in sorted((report.reasons | report.cut).items(), key=lambda row: -row[1]):
                typer.echo(f"  {seconds:8.1f} s  {reason}")
            whole = [row for row in report.dropped if "start" not in row]
            for row in whole[:5]:
                typer.echo(f"  {row['name']}: {row['reason']}")
            if len(whole) > 5:
                typer.echo(f"  and {len(whole) - 5} more: {store / 'report.json'}")
            for note in report.notes:
                typer.echo(f"note: {note}", err=True)


def _add_synthesise(app: typer.Typer) -> None:
    @app.command()
    def synthesise(
        raw: New,
        layout: Layout = "beat",
        speech: Speech = None,
        hours: Hours = 0.5,
        speakers: Speakers = None,
        seed: Seed = 0,
        gestures: Gestures = 0,
        tts: Tts = True,
        act: Act = True,
        neutral: Calm = False,
        coupling: Coupling = None,
        variation: Variation = 1.0,
        silence: Silence = 0.0,
        quiet: Quiet = False,
        debug: Debug = False,
    ) -> None:
        """Make a synthetic corpus, for tests, teaching and practice.

        The rule-based model makes motion for recordings or synthetic voices. The files have the layout of a real corpus.

        \b
        cospeech synthesise raw/beat --layout beat --speech recordings --hours 2
        """
        from ..corpora.synthetic import synthesise as make

        with show_progress("synthesising", quiet) as tell:
            report = make(
                raw,
                layout,
                speech=speech,
                hours=hours,
                speakers=speakers,
                seed=seed,
                gestures=gestures,
                tts=tts,
                act=act,
                neutral=neutral,
                coupling=coupling,
                variation=variation,
                silence=silence,
                progress=tell,
            )
        if not quiet:
            typer.echo(f"{raw}  {report.summary()}")
