"""``cospeech train`` and ``cospeech bundle``: train a model, and pack it into one file. Imports are late, as in `cli.main`."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from ..errors import InputError, describe_extra
from .options import Debug
from .progress import show_progress

if TYPE_CHECKING:
    from ..training import recipe as recipes

__all__ = ["register"]

Recipe = Annotated[
    Path,
    Argument(
        metavar="RECIPE",
        help="Name of a recipe, such as laptop (a small one); `cospeech list recipes` prints them. Or the path of a TOML file.",
    ),
]
Store = Annotated[
    Path | None,
    Option(
        "--store", metavar="STORE",
        help="Folder made by `cospeech prepare`. The default is the recipe's data.store, or else stores/CORPUS.",
    ),
]  # fmt: skip
Set = Annotated[
    list[str] | None,
    Option("--set", metavar="KEY=VALUE", help="Change a key of the recipe: train.steps=2000. Repeat the option for several."),
]
Resume = Annotated[bool, Option("--resume", help="Continue the run in the folder, if there is one.")]
Out = Annotated[
    Path | None, Option("--out", "-o", metavar="FOLDER", help="Folder of the run. The default is runs/ and the recipe's name.")
]
Run = Annotated[
    Path,
    Argument(metavar="RUN", help="Folder made by `cospeech train`; or a bundle of an older version, which is converted."),
]
Bundle = Annotated[Path, Option("--output", "-o", metavar="FILE", help="File to write: NAME.cospeech.")]
Quiet = Annotated[bool, Option("--quiet", "-q", help="Print no progress bar and no summary.")]


@contextmanager
def _training() -> Iterator[None]:
    """If PyTorch is missing, raise an InputError that tells what to install."""
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("torch", "onnx"):
            raise
        problem = f"training needs {error.name}, which is not installed"
        raise InputError(problem, describe_extra("train")) from None


def register(app: typer.Typer) -> None:
    """Add both commands to the program."""
    _add_train(app)
    _add_bundle(app)


def _leave_team() -> None:
    """End a process that `torchrun` started. With a normal exit, gloo's threads could abort it after the work is done."""
    if "TORCHELASTIC_RUN_ID" in os.environ:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(0)


def _add_train(app: typer.Typer) -> None:
    @app.command()
    def train(
        recipe: Recipe,
        *,
        store: Store = None,
        changes: Set = None,
        resume: Resume = False,
        out: Out = None,
        quiet: Quiet = False,
        debug: Debug = False,
    ) -> None:
        """Train a model as a recipe says.

        If the command is stopped, run it again with --resume: the run continues with the recipe and the changes that it
        began with. --set changes train.steps and other keys that may change.

        \b
        cospeech train laptop --store stores/laptop
        cospeech train flow_ted --store stores/ted --set train.steps=2000 --out runs/short
        cospeech train my_recipes/mine.toml --store stores/mine
        torchrun --nproc-per-node 4 -m cospeech train flow_ted --store stores/ted
        """
        from ..training.recipe import load_recipe

        plan, folder = load_recipe(recipe, changes or ()), Path("runs", recipe.stem) if out is None else out
        if resume and (folder / "config.json").exists():
            plan = _continue(plan, folder, changes or [], quiet)
        data = _store(store, plan.data.store, plan.data.corpus)
        with _training():
            from ..training.train import train as run
        with show_progress("training", quiet) as tell:
            report = run(plan, data, folder, resume=resume, progress=tell, notice=lambda text: typer.echo(text, err=True))
        if not (quiet or report.rank):
            typer.echo(f"{report.folder}  {report.step} steps, {report.parameters:,} parameters, {report.seconds:.0f} s")
            if report.best:
                typer.echo(f"  best: {report.best['name']} {report.best['value']:.5g} at step {report.best['step']}")
        _leave_team()


def _continue(plan: recipes.Recipe, folder: Path, changes: list[str], quiet: bool) -> recipes.Recipe:
    """The recipe that a run began with, with the new changes. Prints which of its values differ from the recipe file."""
    with _training():
        from ..training.checkpoint import continue_recipe
        from ..training.recipe import FREE
    own, others = continue_recipe(folder, plan, changes)
    if others and not quiet:
        more = f" and {len(others) - 3} more" if len(others) > 3 else ""
        hint = f"--set changes {', '.join(FREE[1:])} alone"
        typer.echo(f"note: the run keeps its own values: {', '.join(others[:3])}{more} ({hint})", err=True)
    return own


def _store(path: Path | None, recipe: str, corpus: str) -> Path:
    """The folder of the store.

    Raises:
        InputError: neither the user nor the recipe names one.
    """
    if path is not None or recipe:
        return path or Path(recipe)
    if not corpus:
        raise InputError("no store is named", "--store FOLDER, which `cospeech prepare` makes")
    folder = Path("stores", corpus)
    if not folder.is_dir():
        raise InputError(f"there is no store in {str(folder)!r}", "--store names another; `cospeech prepare` makes one")
    return folder


def _add_bundle(app: typer.Typer) -> None:
    @app.command()
    def bundle(run: Run, *, output: Bundle, quiet: Quiet = False, debug: Debug = False) -> None:
        """Pack a trained network into one file, a bundle.

        `cospeech generate --model NAME.cospeech` generates motion with it, without PyTorch.

        \b
        cospeech bundle runs/flow_ted -o mine.cospeech
        cospeech bundle old.cospeech -o new.cospeech
        """
        if run.is_file():
            from ..runtime.bundles.convert_bundle import convert_bundle

            convert_bundle(run, output)
        else:
            with _training(), show_progress("bundling:", quiet) as tell:
                from ..training.export.bundles import bundle_run

                bundle_run(run, output, progress=tell)
        if not quiet:
            typer.echo(f"{output}  {output.stat().st_size / 1e6:.1f} MB")
