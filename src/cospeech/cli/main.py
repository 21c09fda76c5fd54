"""The command line. A command reads its arguments, calls the library once, and prints the result. It computes nothing itself.

Imports are late: a command imports the modules that it needs when it runs, so that ``cospeech --help`` answers at once.
"""

from __future__ import annotations

import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from typer import Argument, Option

from .. import __version__
from ..errors import CospeechError, CospeechWarning, InputError, InternalError, say_count
from ..models import DEFAULT, PARTS
from ..training.interrupts import list_stop_signals
from . import convert as cli_convert
from . import corpora as cli_corpora
from . import dialogue as cli_dialogue
from . import evaluate as cli_evaluate
from . import robot as cli_robot
from . import stream as cli_stream
from . import studio as cli_studio
from . import study as cli_study
from . import train as cli_train
from .commands import Commands
from .options import (  # fmt: skip
    Audio,
    Avatar,
    Continue,
    Debug,
    Emotion,
    Face,
    FaceGain,
    Folder,
    Fps,
    Intensity,
    Jobs,
    Json,
    Language,
    Model,
    Output,
    Parts,
    Quiet,
    ReportFile,
    Resume,
    RigMap,
    Seed,
    Skeleton,
    Speaker,
    Style,
    Tail,
    Takes,
    Temperature,
    Transcribe,
    Transcript,
    number,
    option,
)
from .plan_options import AddGesture, Keep, Lock, MoveGesture, PlanFile, PlanOut, RemoveGesture, Reseed, SetStretch
from .progress import show_progress
from .standard_streams import ready_streams
from .transcript_options import Offset, Tier, describe_transcript

if TYPE_CHECKING:
    from ..runtime.report import Report, Reports

__all__ = ["app", "main", "show_outputs"]

INTERRUPTED = 130  # 128 + SIGINT, as shells say
ALL_PARTS = ",".join(PARTS)
LOOK_UP = ("generate", "convert", "render")
"""Commands that expand patterns of files themselves. The names of their outputs depend on the folders of a pattern."""

app = Commands(
    name="cospeech",
    help="cospeech turns recorded speech into a moving character: face, body and hands, in files that your tools open.",
    epilog="What you generate is yours. `cospeech COMMAND --help` explains a command. The manual is in docs/.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context, version: Annotated[bool, Option("--version", "-V", help="Show the version and exit.")] = False
) -> None:
    if version:
        print(f"cospeech {__version__}")
    elif context.invoked_subcommand is None:
        print(context.get_help())


@app.command()
def generate(
    audio: Audio, output: Output = None, model: Model = DEFAULT, style: Style = None, emotion: Emotion = "auto",
    speaker: Speaker = None, transcript: Transcript = None, offset: Offset = 0.0, tier: Tier = "",
    transcribe: Transcribe = False, language: Language = "",
    seed: Seed = 0, takes: Takes = 1, temperature: Temperature = 1.0, intensity: Intensity = 1.0, parts: Parts = ALL_PARTS,
    face_gain: FaceGain = "1",
    face: Face = None, continue_from: Continue = None, skeleton: Skeleton = "humanoid", names: RigMap = None,
    fps: Fps = 30.0, tail: Tail = 0.0, avatar: Avatar = None, report: ReportFile = None, plan: PlanFile = None,
    plan_out: PlanOut = None, gesture: AddGesture = None, remove: RemoveGesture = None, move: MoveGesture = None,
    stretch: SetStretch = None, reseed: Reseed = None, lock: Lock = None, keep: Keep = None, jobs: Jobs = 1,
    resume: Resume = False, quiet: Quiet = False, debug: Debug = False,
) -> None:  # fmt: skip
    """Generate motion for one speech or for several.

    \b
    cospeech generate talk.wav -o talk.bvh -o talk.glb
    cospeech generate monday.wav tuesday.wav recordings -o out/
    recorder | cospeech generate - -o talk.bvh
    cospeech generate talk.wav -o talk.vrma --style lively --transcript talk.srt
    cospeech generate talk.wav -o talk.bvh --model mine.cospeech --style clip.bvh
    cospeech generate talk.wav -o talk.glb --emotion moods.csv --face-gain 1.2,jawOpen:0.9
    cospeech generate talk.wav -o talk.bvh --plan-out plan.json
    cospeech generate talk.wav -o talk.bvh --plan plan.json --remove g3 --gesture huge@2.4
    """
    from ..rules.plan_commands import PlanCommands
    from .batch import generate_speeches

    edits = PlanCommands(
        lock=lock or (), remove=remove or (), move=move or (), stretch=stretch or (), reseed=reseed or (), gesture=gesture or ()
    )
    stretches, old = keep or ("", None)
    words = describe_transcript(transcript, offset, tier)

    with show_progress("generating", quiet) as progress:
        results = generate_speeches(
            audio, output or (), model=model, style=style, emotion=emotion, speaker=speaker, transcript=words,
            transcribe=transcribe, language=language, seed=seed, takes=takes, temperature=temperature, intensity=intensity,
            parts=[p.strip() for p in parts.split(",") if p.strip()], face_gain=face_gain, face=face,
            continue_from=continue_from, skeleton=skeleton, bone_map=names, fps=fps, tail=tail, avatar=avatar, report=report,
            progress=progress, plan=plan, plan_out=plan_out, plan_edits=edits, keep=stretches, keep_from=old, jobs=jobs,
            resume=resume,
        )  # fmt: skip
    if not quiet:
        show_outputs(results.speeches)
    if results.failed:
        raise _failure(results)


def _failure(results: Reports) -> CospeechError:
    """The error for the speeches that failed."""
    from .several import describe_failures

    failures = [(failure.speech, failure.error, failure.ours) for failure in results.failed]
    every = say_count(len(failures) + len(results.speeches), "speech", "speeches")
    hint = "--report FILE lists all; the others are done" if results.speeches else "--report FILE lists all"
    return describe_failures(failures, every, hint)


@app.command("list")
def list_(
    what: Annotated[
        str, Argument(metavar="WHAT", help="models, styles, emotions, formats, skeletons, metrics, corpora or recipes.")
    ],
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """List the models, styles, formats and so on.

    \b
    cospeech list models"""
    from .catalogue import catalogue, catalogue_text

    if as_json:
        import json

        print(json.dumps(catalogue(what), indent=2, ensure_ascii=False))
    else:
        print(catalogue_text(what))


@app.command()
def demo(folder: Folder = Path("demo"), quiet: Quiet = False, debug: Debug = False) -> None:
    """Generate every kind of file from the example speech.

    The formats are those of `cospeech list formats` without .gif. The .mp4 needs the extra `av`.

    \b
    cospeech demo --to demo
    """
    from .demo import make_demo

    with show_progress("making the demo", quiet) as progress:
        result = make_demo(folder, progress=progress)
    if not quiet:
        show_outputs([result])


@app.command()
def bench(
    seconds: Annotated[
        float, option("--seconds", metavar="NUMBER", parser=number, help="Length of the speech, 1 … 36000.")
    ] = 60.0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Measure the speed of the default model on this machine.

    A real-time factor is seconds of work per second of speech. Below 1 is faster than the speech.

    \b
    cospeech bench --seconds 60
    """
    from .bench import measure

    rows = measure(seconds)
    if as_json:
        import json

        print(json.dumps(rows, indent=2, ensure_ascii=False))
        return
    width = max(len(str(row["what"])) for row in rows)
    for row in rows:
        print(f"{row['what']:<{width}}  {row['value']:>9.4g} {row['unit']:<4}  {row['note']}")


def show_outputs(results: list[Report]) -> None:
    """Print the files, and which programs open them, once per suffix."""
    from ..export import format_of

    if not results:
        return
    work_seconds = sum(result.realtime_factor * result.speech_seconds * result.takes for result in results)
    seconds, frames = (sum(values) for values in zip(*((r.speech_seconds, r.frames) for r in results), strict=True))
    what = "" if len(results) == 1 else f"{len(results)} speeches: "
    print(
        f"{what}{seconds:.2f} s of speech, {say_count(frames, 'frame')} at {results[0].fps:g} fps, made in {work_seconds:.1f} s"
    )
    outputs = [name for result in results for name in result.outputs]
    width = max(map(len, outputs))
    suffixes = set()
    for name in outputs:
        suffix = Path(name).suffix.lower()
        print(f"  {name}" if suffix in suffixes else f"  {name:<{width}}  {format_of(name).opens}")
        suffixes.add(suffix)


cli_convert.register(app)
cli_corpora.register(app)
cli_dialogue.register(app)
cli_evaluate.register(app)
cli_robot.register(app)
cli_stream.register(app)
cli_study.register(app)
cli_studio.register(app)
cli_train.register(app)


def _usage_error(error: typer.TyperException) -> InputError:
    """An error of Typer as one of ours: the problem, and a hint how to mend it."""
    what, _, rest = error.format_message().replace("\n", " ").strip().partition(". ")
    if not rest and what.endswith(")") and " (" in what:
        what, _, rest = what[:-1].partition(" (")
    context = getattr(error, "ctx", None)  # the error of an option without its value has no context
    param = getattr(error, "param", None)
    if context and param is not None and param.nargs == -1 and param.required:  # the words given became the last argument
        names = [str(each.metavar) for each in context.command.params if each.param_type_name == "argument" and each.required]
        what = f"missing argument: {' and '.join(names)} are needed" if len(names) > 1 else what
    command_words = [word for word in sys.argv[1:2] if word in typer.main.get_group(app).commands]
    command = context.command_path if context else " ".join(["cospeech", *command_words])
    hint = rest.strip().rstrip(".") or f"see `{command} --help`"
    return InputError(what[:1].lower() + what[1:].rstrip("."), hint[:1].lower() + hint[1:])


def _note_signals() -> list[int]:
    """Let signals end the program as Ctrl-C does, so that half-written files are removed.

    Returns:
        A list that gets the number of each signal that comes. It is needed because the code that a handler interrupts, such as
        a library during its import, may turn the handler's exception into another one.
    """
    numbers: list[int] = []

    def stop(number: int, frame: object) -> NoReturn:
        numbers.append(number)
        raise KeyboardInterrupt if number == signal.SIGINT else SystemExit(128 + number)

    for each in list_stop_signals():
        signal.signal(each, stop)
    return numbers


def main() -> None:
    """Run the command line. Exit codes: 0 done, 1 our failure, 2 an argument or file cannot be used, 130 interrupted."""
    ready_streams()
    signals = _note_signals()
    try:
        with _noting():
            expand = not {*sys.argv[1:2]} & {*LOOK_UP}  # patterns, which the shell of Windows does not expand
            code = app(prog_name="cospeech", standalone_mode=False, windows_expand_args=expand)
        sys.stdout.flush()  # an error of writing is raised here
    except (Exception, KeyboardInterrupt, SystemExit) as problem:  # Typer turns Ctrl-C in the command itself into a code
        if not signals or isinstance(problem, CospeechError):  # after a signal, libraries may fail in any other way
            code = _tell(problem)
        code = 128 + signals[0] if signals else code
    if code == INTERRUPTED:
        print("interrupted", file=sys.stderr)
    try:
        sys.stdout.flush()
    except OSError:
        sys.stdout = None  # type: ignore[assignment]  # Python does not try again at exit
    sys.exit(code)


def _tell(problem: BaseException) -> int:
    """Print the error of an exception, and return the exit code.

    Raises:
        SystemExit: the exception is one; the code that raised it has printed the reason.
    """
    if isinstance(problem, KeyboardInterrupt):
        return INTERRUPTED
    exits = isinstance(problem, SystemExit)
    if isinstance(problem.__context__ if exits else problem, BrokenPipeError):
        return 0  # the reader of our output has closed it, as `head` does; Typer turns that into an exit with 1
    if exits:
        raise problem
    if isinstance(problem, CospeechError):
        error = problem
    elif isinstance(problem, typer.TyperException):
        error = _usage_error(problem)
    else:
        from .unexpected import explain

        assert isinstance(problem, Exception)
        error = explain(problem, next(iter(sys.argv[1:]), ""))
    return _say(error, 1 if isinstance(error, InternalError) else 2)


@contextmanager
def _noting() -> Iterator[None]:
    """Print our warnings as lines on stderr, each text once: a file may be read twice."""
    lines = set[str]()
    with warnings.catch_warnings():
        warnings.simplefilter("always", CospeechWarning)
        usual = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: Any) -> None:
            if issubclass(category, CospeechWarning):
                line = f"note: {' '.join(str(message).split())}"
                if line not in lines:
                    lines.add(line)
                    print(line, file=sys.stderr)
            else:
                usual(message, category, *where)

        warnings.showwarning = show  # type: ignore[assignment]
        yield


def _say(error: CospeechError, code: int) -> int:
    if "--debug" in sys.argv:
        import traceback

        traceback.print_exc()
    with suppress(OSError):  # stderr cannot be written; the exit code still tells
        print(f"error: {' '.join(str(error).split())}", file=sys.stderr)
    return code


if __name__ == "__main__":
    main()
