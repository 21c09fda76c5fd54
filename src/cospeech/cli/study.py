"""``cospeech study``: it makes a study with human raters, serves its page, and reports the results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from ..errors import say_count
from .commands import Commands
from .options import Debug, Fps, Json, Port, Quiet, option, whole
from .progress import show_progress

__all__ = ["register"]

study_app = Commands(
    help="Study with human raters: make it, serve it, report it.",
    no_args_is_help=True,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)

Study = Annotated[Path, Argument(metavar="STUDY", help="Folder of the study.")]
Clips = Annotated[
    list[Path],
    Argument(
        metavar="FOLDERS",
        help="A folder of clips for each system. Clips with the same file name belong to the same speech. Clips are videos "
        "(.mp4, .webm) or motion files, which are rendered.",
    ),
]
Kind = Annotated[
    str,
    option("--template", metavar="NAME", help="preference, appropriateness, mix-stage, chain-of-generation or stylised-flow."),
]
Variant = Annotated[
    str,
    option("--variant", metavar="NAME", help="full; mute: without sound; hands: motion files with the camera on the hands."),
]
Reference = Annotated[
    str | None, option("--reference", metavar="NAME", help="Pair every system with this one, usually the recordings.")
]
Transfer = Annotated[
    list[str] | None,
    option(
        "--transfer",
        metavar="NAME",
        help="A system whose style should differ from the reference's. Repeat the option for several.",
    ),
]
SpeechFolder = Annotated[
    Path | None,
    option("--speech", metavar="FOLDER", help="Sound files with the names of the motion files. Default: the same folders."),
]
Each = Annotated[
    int | None,
    option(
        "--speeches",
        metavar="NUMBER",
        parser=whole,
        help="Speeches that each rater sees, with all systems. Default: the template's.",
    ),
]
Checks = Annotated[int, option("--checks", metavar="NUMBER", parser=whole, help="Attention checks in each session, 0 … 20.")]
StudySeed = Annotated[
    int | None,
    option("--seed", metavar="NUMBER", parser=whole, help="Seed of orders and blind names. Default: a random one."),
]
Completion = Annotated[
    str, option("--completion", metavar="URL", help="Address of a recruiting platform, to which the last page leads.")
]
Faces = Annotated[
    str,
    option(
        "--faces",
        metavar="NAME",
        help="Faces of motion files: show, hide, or auto, which hides all faces if one clip has none.",
    ),
]
Differences = Annotated[
    bool, Option("--allow-differences", help="Take videos that differ in size, rate, kind, sound or length.")
]
Title = Annotated[str, option("--title", metavar="TEXT", help="Title of the page.")]
Host = Annotated[
    str,
    option(
        "--host",
        metavar="ADDRESS",
        help="Address to listen at. Any other than 127.0.0.1 opens the page to a network; raters then need "
        "the printed address with its token.",
    ),
]
Sessions = Annotated[int, option("--sessions", metavar="NUMBER", parser=whole, help="Different orders in the page, 1 … 5000.")]
Tables = Annotated[
    Path | None, option("--tables", metavar="FOLDER", help="Also write the answers as CSV files, votes in GENEA's layout.")
]
Incomplete = Annotated[bool, Option("--incomplete", help="Count raters who stopped early, too.")]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.add_typer(study_app, name="study")


@study_app.command()
def make(
    folders: Clips,
    output: Annotated[Path, option("--output", "-o", metavar="STUDY", help="Folder to make.")],
    template: Kind = "preference",
    variant: Variant = "full",
    reference: Reference = None,
    transfer: Transfer = None,
    speech: SpeechFolder = None,
    speeches: Each = None,
    checks: Checks = 2,
    seed: StudySeed = None,
    title: Title = "Gestures and speech",
    completion: Completion = "",
    faces: Faces = "auto",
    fps: Fps = 30.0,
    allow_differences: Differences = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Make a study from clips of several systems on the same speech.

    \b
    cospeech study make ours theirs -o study
    cospeech study make recordings ours theirs -o study --template mix-stage --reference recordings
    cospeech study make ours theirs -o study --template appropriateness --speech talks
    """
    from ..studio.study.make import make_study

    with show_progress("making the study", quiet) as progress:
        plan = make_study(
            folders, output, template=template, variant=variant, reference=reference, transfer=transfer or (), speech=speech,
            stimuli_each=speeches, checks=checks, seed=seed, title=title, completion=completion, faces=faces, fps=fps,
            allow_differences=allow_differences, progress=progress,
        )  # fmt: skip
    if not quiet:
        from ..studio.study.session import make_session

        typer.echo(
            f"{output}  {say_count(len(plan.systems), 'system')}, {say_count(len(plan.stimuli), 'speech', 'speeches')}, "
            f"{say_count(len(make_session(plan, 0)), 'page')} a rater"
        )
        typer.echo(f"  put your own words for consent into {output / 'plan.json'}, then: cospeech study serve {output}")


@study_app.command()
def serve(study: Study, host: Host = "127.0.0.1", port: Port = 8766, debug: Debug = False) -> None:
    """Serve the page of a study until Ctrl-C. Answers are kept in the folder of the study.

    \b
    cospeech study serve study
    cospeech study serve study --host 0.0.0.0 --port 8000
    """
    from ..studio.server import is_loopback, list_addresses, load_web, make_token, open_socket, run_server
    from ..studio.study.answers import Answers
    from ..studio.study.app import make_app
    from ..studio.study.plan import load_plan

    load_web("uvicorn")
    plan = load_plan(study)
    token = None if is_loopback(host) else make_token()
    with Answers(study, plan) as answers:
        app = make_app(study, plan, answers, token=token)
        listening = open_socket(host, port)
        address, *others = list_addresses(host, listening, token)
        typer.echo(f"the study is at {address}  (Ctrl-C ends)")
        for other in others:
            typer.echo(f"  from other computers: {other}")
        run_server(app, listening)


@study_app.command("export")
def export_(
    study: Study,
    page: Annotated[Path, Argument(metavar="PAGE", help="Folder to make.")],
    sessions: Sessions = 200,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write a study as a folder for any web space.

    \b
    cospeech study export study page
    """
    from ..studio.study.static import export_page

    plan = export_page(study, page, sessions=sessions)
    if not quiet:
        counts = f"{say_count(len(plan.clips), 'clip')}, {say_count(sessions, 'order')}"
        typer.echo(f"{page}  {counts}; raters send you the file that the page saves")


@study_app.command("import")
def import_(
    study: Study,
    files: Annotated[list[Path], Argument(metavar="FILES", help="Files that raters of an exported page have sent.")],
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Take in the files that raters of an exported page have sent.

    \b
    cospeech study import study answers-*.json
    """
    from ..studio.study.static import import_answers

    result = import_answers(study, files)
    if not quiet:
        twice = f", {result.twice} left out: another session of the participant is there" if result.twice else ""
        typer.echo(f"{study}  {say_count(result.added, 'session')} added, {result.known} known already{twice}")


@study_app.command()
def report(
    study: Study,
    tables: Tables = None,
    incomplete: Incomplete = False,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Report means, differences, and how much the raters agree.

    \b
    cospeech study report study
    cospeech study report study --tables answers
    """
    import json

    from ..studio.study.report import findings_json, report_study
    from ..studio.study.tables import write_tables

    text, findings = report_study(study, incomplete=incomplete)
    files = [] if tables is None else write_tables(study, tables, incomplete=incomplete)
    if as_json:
        typer.echo(json.dumps(findings_json(findings), indent=2, ensure_ascii=False))
        return
    typer.echo(text)
    for path in files if not quiet else ():
        typer.echo(path)
