"""The training loop of all models: a model declares objectives (`cospeech.models.nn.objective`), the loop minimises them.

A step does this for each objective that is due: loss, gradients, their average over the processes, clipping, Adam. Random
numbers depend on seed and step alone, so that a run that was killed and resumed gives the same as one that was not. A run that
is asked to stop gives up a step that takes long, goes back to the state before it, and saves that.
"""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass
from math import isfinite
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Any

import torch
from torch import Tensor

from ..corpora.store import Store
from ..errors import CospeechError, InputError, nearest
from ..models.nn.named_initialisation import initialise_by_name
from ..models.nn.objective import Batch, StepRandom
from ..models.nn.sampled import Sampled
from .batch_loader import BatchLoader
from .checkpoint import build_model, read_facts, read_tensors, write_facts, write_tensors
from .dataset import check_same, open_set
from .interrupts import SignalWatch, Stopped, defer_signals
from .objective_optimiser import ObjectiveOptimiser, list_objectives, with_prefix
from .processes import Team, average, join, mean_values, surroundings
from .recipe import Recipe
from .renamed import suggest_key
from .run_log import RunLog, open_board
from .running_average import RunningAverage
from .signals import let_signals_in
from .start import start_from

__all__ = ["TrainReport", "train"]

Tell = Callable[[float, float | None, str], None]
Snapshot = tuple[dict[str, Tensor], dict[str, Any]]
PROMPT = 0.5  # seconds; ours: a step that takes no longer is finished before a run stops
VALIDATION = 2**40  # ours: "steps" from here on are validation batches; no run gets that far


@dataclass(frozen=True)
class TrainReport:
    """The result of a run."""

    folder: Path
    step: int
    resumed: int
    """Step from which it continued; 0: it is a new run."""
    parameters: int
    best: dict[str, Any] | None
    """``name``, ``value`` and ``step`` of the best validation."""
    seconds: float
    rank: int
    """Number of this process; 0 is the one that writes files and reports."""


class _Run:
    """One run in one process."""

    def __init__(self, recipe: Recipe, store: Store, folder: Path, team: Team, resume: bool) -> None:
        self.settings, self.folder, self.team = recipe.train, folder, team
        if self.settings.batch % team.size:
            raise InputError(f"a batch of {self.settings.batch} for {team.size} processes", "each takes an equal part")
        work = open_set(recipe, store, team.device)
        there = (folder / "config.json").exists()
        if there and not resume:
            raise InputError(f"there is a run in {str(folder)!r} already", "--resume continues it; --out names another folder")
        if there:
            check_same(read_facts(folder), work.facts, read_tensors(folder / "statistics.safetensors")[0], work.statistics)
        self.seed(0)
        model = initialise_by_name(lambda: build_model(work.facts, work.needs), self.settings.seed)
        self.model = model.to(team.device)
        if self.settings.batch < self.model.smallest_batch:
            raise InputError(f"train.batch is {self.settings.batch}", f"at least {self.model.smallest_batch} for this network")
        self.total = self.settings.steps + self.model.preliminary_steps
        self.model.set_statistics(work.statistics)
        self.parts = [ObjectiveOptimiser(name, part, self.settings.of(name)) for name, part in list_objectives(self.model)]
        if unknown := {*self.settings.objectives} - {part.name for part in self.parts}:
            raise InputError(
                f"no objective {min(unknown)!r} in [train]", suggest_key(min(unknown), [p.name for p in self.parts])
            )
        self.feed = work.feed(self.model, "train", self.settings.balance)
        self.validation: BatchLoader | None = (
            work.feed(self.model, "validation", False) if self.settings.validate_every else None
        )
        self.start_note = ""
        if self.settings.start and not there:
            self.start_note = start_from(self.model, self.settings.start, self.batch(self.feed, 0).arrays)
        self.average = RunningAverage(self.model, self.settings.ema)
        self.steps_done = 0
        self.steps_saved, self.slow = 0, True  # the step that last.safetensors holds; whether steps take longer than `PROMPT`
        self.best: dict[str, Any] | None = None
        self.latest: dict[str, dict[str, dict[str, float]]] = {}
        if there and (folder / "last.safetensors").exists():
            self._restore()
        if self.steps_done > self.total:
            steps = self.steps_done - self.model.preliminary_steps
            raise InputError(f"{str(folder)!r} has {steps} steps already", "set more train.steps")
        self.first_step = self.steps_done
        if mean_values([self.steps_done], team) != [self.steps_done]:  # all have read before one writes
            raise InputError(f"processes see different runs in {str(folder)!r}", "it must be the same folder for all machines")
        if team.rank == 0 and not there:
            write_facts(folder, work.facts, {"statistics": work.statistics, "examples": work.examples()})
        elif team.rank == 0 and (facts := read_facts(folder))["recipe"] != (own := json.loads(json.dumps(recipe.to_dict()))):
            write_facts(folder, facts | {"recipe": own}, {})  # changes, of steps say, hold when it continues again

    def _restore(self) -> None:
        snapshot = read_tensors(self.folder / "last.safetensors")
        try:
            self._put_back(snapshot)
            self.steps_saved = self.steps_done
        except (KeyError, RuntimeError, TypeError, ValueError) as error:
            reason = (str(error).splitlines() or [type(error).__name__])[-1].strip()
            raise InputError(f"cannot go on with {str(self.folder)!r}: {reason}"[:200], "begin another run") from None

    def _put_back(self, snapshot: Snapshot) -> None:
        """Restore the run to a `state`."""
        tensors, state = snapshot
        before = state.get("preliminary_steps", 0 if isinstance(self.model, Sampled) else self.model.preliminary_steps)
        if before != self.model.preliminary_steps:  # runs of `Sampled` did not keep it; they counted all steps
            raise ValueError(f"its first stages had {before} uncounted steps, and have {self.model.preliminary_steps} now")
        self.model.load_state_dict(with_prefix("model.", tensors))
        self.steps_done = int(state["step"]) + self.model.preliminary_steps
        self.best, self.latest = state["best"], state["latest"]
        self.average.restore(with_prefix("ema.", tensors))
        for part in self.parts:
            part.restore(tensors)

    def seed(self, step: int) -> None:
        """Seed layers that draw random numbers themselves, such as dropout, by seed, step and process; see `surroundings`."""
        torch.random.manual_seed(((self.settings.seed * 1_000_003 + step) * 1009 + self.team.rank * (step > 0)) % 2**63)

    @contextmanager
    def autocast(self) -> Iterator[None]:
        """Mixed precision, where the recipe has it.

        Raises:
            InputError: the processor has no such product for a layer of the network.
        """
        try:
            with torch.autocast(self.team.device.type, torch.bfloat16, enabled=self.settings.precision == "bfloat16"):
                yield
        except RuntimeError as error:
            if self.settings.precision != "bfloat16" or "could not create a primitive" not in str(error):
                raise
            problem = f"this processor cannot train {self.model.__class__.__name__} in bfloat16"
            raise InputError(problem, "set train.precision=float32") from None

    def batch(self, feed: BatchLoader, step: int) -> Batch:
        """This process's rows of a step's batch."""
        rank, size, device = self.team
        arrays = feed.at(self.settings.batch, self.settings.seed, step, rank=rank, parts=size)
        tensors = {name: torch.from_numpy(array).to(device) for name, array in arrays.items()}
        return Batch(tensors, StepRandom(self.settings.seed, step, rank, size, device))

    def step(self, stop: bool) -> bool:
        """Do one step; return whether any process was asked to stop."""
        step, stopping = self.steps_done, False
        self.seed(step + 1)
        batch = self.batch(self.feed, step)
        self.model.train()
        for part in self.parts:
            if not part.objective.is_active_at(step):
                continue
            with self.autocast():
                terms = part.terms(batch, step)
            total = torch.stack([term.float() for term in terms.values()]).sum()
            if self.slow:
                let_signals_in(total)
            gradients = part.gradients(total)
            average(gradients, self.team)
            norm = torch.nn.utils.get_total_norm(gradients)
            *values, size, stop_share = mean_values([*terms.values(), norm, float(stop)], self.team)
            for name, value in [*zip(terms, values, strict=True), ("gradient", size)]:
                self._finite(value, f"{name!r} of the objective {part.name!r}", step + 1)
            losses = {f"{part.name}.{name}": value for name, value in zip(terms, values, strict=True)}
            latest = self.latest.setdefault(part.name, {"loss": {}, "gradient": {}, "rate": {}})
            latest["loss"] |= {part.name: sum(values), **losses}
            latest["gradient"][part.name], latest["rate"][part.name] = size, part.update(step)
            stopping = stopping or stop_share > 0
        self.average.follow(self.steps_done)
        self.steps_done += 1
        return stopping

    def row(self) -> dict[str, dict[str, float]]:
        """The latest figures of the active objectives; an objective, or a term of it, need not be in every step."""
        figures: dict[str, dict[str, float]] = {"loss": {}, "gradient": {}, "rate": {}}
        for part in self.parts:
            for kind, values in self.latest.get(part.name, {}).items() if part.active(self.steps_done - 1) else ():
                figures[kind] |= values
        return figures

    def _describe_losses(self) -> str:
        losses = self.row()["loss"]
        return ", ".join(f"{part.name} {losses[part.name]:.4g}" for part in self.parts if part.name in losses)

    def _finite(self, value: float, what: str, step: int) -> None:
        if not isfinite(value):
            hint = "a lower train.lr or clipping may help; last.safetensors is from before, where the run had saved"
            raise CospeechError(f"training has diverged: {what} is {value} in step {step}", hint)

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Figures as means over the same batches of the validation split every time; the best parameters are kept."""
        if self.validation is None:
            return {}
        self.model.eval()
        count, sums = self.settings.validate_batches, dict[str, Tensor | float]()
        with self.average.instead():
            for k in range(count):
                for name, value in self._figures(self.batch(self.validation, VALIDATION + k)).items():
                    sums[name] = sums.get(name, 0.0) + value
            means = mean_values([total / count for total in sums.values()], self.team)
            figures = dict(zip(sums, means, strict=True))
            name = self.settings.best or next(iter(figures))
            if name not in figures:
                stage = name.partition(".")[0]
                if any(part.name == stage and not part.active(self.steps_done - 1) for part in self.parts):
                    return figures  # it has not begun, or is over
                raise InputError(f"train.best is {name!r}", nearest(name, figures))
            self._finite(figures[name], f"the validation figure {name!r}", self.steps_done)
            if self.best is None or self.best["name"] != name or figures[name] < self.best["value"]:
                self.best = {"name": name, "value": figures[name], "step": self.steps_done}
                self._save_best()
        return figures

    def _figures(self, batch: Batch) -> dict[str, Tensor | float]:
        """The model's own measures, or else its losses: the sum and each term of each active objective.

        Weights and choice of terms are those of the objective's first step, so that figures of all steps can be compared.
        """
        figures: dict[str, Tensor | float] = {**self.model.validate(batch)}
        for part in self.parts if not figures else ():
            if part.active(self.steps_done - 1):
                with self.autocast():
                    terms = part.terms(batch, part.objective.start)
                figures[part.name] = torch.stack([term.float() for term in terms.values()]).sum()
                figures |= {f"{part.name}.{name}": term for name, term in terms.items()}
        return figures

    def _save_best(self) -> None:
        if self.team.rank == 0:
            write_tensors(
                self.folder / "best.safetensors", self.model.state_dict(), {"step": self.steps_done, "best": self.best}
            )

    def save(self) -> None:
        """Save all that is needed to continue, as one file."""
        if self.team.rank != 0:
            return
        if self.validation is None:
            with self.average.instead():
                self._save_best()
        write_tensors(self.folder / "last.safetensors", *self.state())
        self.steps_saved = self.steps_done

    def state(self) -> Snapshot:
        """Tensors and facts of everything that a step changes; not copied."""
        tensors = {f"model.{name}": tensor for name, tensor in self.model.state_dict().items()}
        tensors |= {f"ema.{name}": tensor for name, tensor in self.average.values.items()}
        for part in self.parts:
            tensors |= part.state()
        first = self.model.preliminary_steps
        return tensors, {"step": self.steps_done - first, "preliminary_steps": first, "best": self.best, "latest": self.latest}

    def _keep(self) -> Snapshot | None:
        """A copy of `state`, to go back to; None where last.safetensors holds it, or the next step will be short."""
        validates = self.validation is not None and (self.steps_done + 1) % self.settings.validate_every == 0
        if self.steps_saved == self.steps_done or not (self.slow or validates or self.steps_done + 1 == self.total):
            return None
        tensors, state = self.state()
        return {name: tensor.detach().to("cpu", copy=True) for name, tensor in tensors.items()}, deepcopy(state)

    def loop(self, log: _Rows, watch: SignalWatch, progress: Tell | None) -> bool:
        """Do all steps that are left; return whether the run was stopped before the last one."""
        last, stopping, alone = self.total, False, self.team.size == 1
        while self.steps_done < last and not stopping and not (alone and watch.numbers):
            began, snapshot = perf_counter(), self._keep() if alone else None
            try:
                with watch.raise_at_once(snapshot is not None or (alone and self.steps_saved == self.steps_done)):
                    stopping = self.step(bool(watch.numbers))
                    end = stopping or self.steps_done == last
                    log.step(self, end)
                    if self.validation is not None and (
                        self.steps_done % self.settings.validate_every == 0 or self.steps_done == last
                    ):
                        log.write(self.steps_done, {"validation": self.validate()})
            except Stopped:
                if snapshot is not None:
                    self._put_back(snapshot)
                else:
                    self.steps_done = self.steps_saved
                break
            self.slow = perf_counter() - began > PROMPT
            if self.steps_done % self.settings.save_every == 0 or end:
                self.save()
            if progress is not None:
                progress(self.steps_done, last, self._describe_losses())
        if alone and watch.numbers and self.steps_saved != self.steps_done:
            self.save()
        mean_values([self.steps_done], self.team)  # nobody leaves before all is saved
        return stopping or bool(alone and watch.numbers and self.steps_done < last)


class _Rows:
    """Writes rows of the log, in the process that has the log."""

    def __init__(self, log: RunLog | None, run: _Run) -> None:
        self._log, self._mark, self._settings = log, run.steps_done, run.settings
        self._began = self._since = perf_counter()

    def write(self, step: int, row: dict[str, Any]) -> None:
        if self._log is not None:
            self._log.write(step, row)

    def step(self, run: _Run, end: bool) -> None:
        """The figures of a step, where they are due."""
        if self._log is None or not (run.steps_done % self._settings.log_every == 0 or end):
            return
        now = perf_counter()
        speed = (run.steps_done - self._mark) * self._settings.batch / (now - self._since)
        self.write(run.steps_done, run.row() | {"seconds": now - self._began, "windows_per_second": speed})
        self._mark, self._since = run.steps_done, now


def _run_loop(run: _Run, watch: SignalWatch, progress: Tell | None) -> bool:
    """Run the loop, with its log; return whether it was stopped."""
    log = None
    if run.team.rank == 0:
        board = open_board(run.folder, run.steps_done) if run.settings.tensorboard else None
        log = RunLog(run.folder / "log.jsonl", run.steps_done, board)
    try:
        return run.loop(_Rows(log, run), watch, progress)
    finally:
        if log is not None:
            log.close()


def train(
    recipe: Recipe,
    store: Store | str | PathLike[str],
    out: str | PathLike[str],
    *,
    resume: bool = False,
    progress: Tell | None = None,
    notice: Callable[[str], None] | None = None,
    hint: str = "--resume goes on",
) -> TrainReport:
    """Train a model, alone or as one of the processes that ``torchrun`` has started.

    >>> train(load_recipe("recipes/x.toml"), "stores/ted", "runs/x").best           # doctest: +SKIP
    {'name': 'flow', 'value': 0.83, 'step': 4000}

    Args:
        recipe: what is trained and how; see `cospeech.training.recipe.load_recipe`.
        store: what it is trained on.
        out: run folder, made where it is missing; docs/training.md says what it holds.
        resume: go on with the run in ``out``, where there is one.
        progress: is told (steps done, of how many, a word about the loss).
        notice: is told that the run stops, as soon as a signal asks for it, and then what was saved.
        hint: how the user can continue the run; told with what was saved.

    Raises:
        InputError: recipe and store do not fit, there is a run already, or it cannot be continued.
        CospeechError: a loss or a gradient is no number any more; what was saved stays.
        KeyboardInterrupt: Ctrl-C, after the steps that are done were saved; a second one ends it at once. With several
            processes, each finishes its step first.
    """
    began, folder, run = perf_counter(), Path(out), None
    tell = notice or (lambda text: None)
    with defer_signals(lambda: tell("stopping; what is done will be saved (once more: without saving)")) as watch:
        try:
            with join(recipe.train.device) as team, surroundings(recipe.train.threads, team.device):
                with watch.raise_at_once(team.size == 1):
                    run = _Run(recipe, store if isinstance(store, Store) else Store(store), folder, team, resume)
                if run.start_note and team.rank == 0:
                    tell(run.start_note)
                stopping = _run_loop(run, watch, progress if team.rank == 0 else None)
        except Stopped:
            stopping = True
        if stopping:
            step = run.steps_saved if run is not None else 0
            tell(f"saved at step {step}: {hint}" if step else "no step was done yet: there is nothing to save")
    if stopping or run is None:
        if watch.numbers:
            signal.raise_signal(watch.numbers[0])  # as it would have ended the program
        raise KeyboardInterrupt
    count = sum(p.numel() for p in run.model.parameters())
    return TrainReport(folder, run.steps_done, run.first_step, count, run.best, perf_counter() - began, team.rank)
