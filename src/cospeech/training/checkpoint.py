"""The files of a run: safetensors and JSON, which execute nothing when they are read.

A run folder holds ``config.json`` (model, its config and sizes, the recipe, facts of the store), ``statistics.safetensors``
(``pose_mean``, ``pose_std``, ``audio_mean``, ``audio_std``), ``examples.safetensors`` (the data that a bundle needs, see
`cospeech.training.calibration_clips`), ``last.safetensors`` (everything that is needed to continue, as one file: parameters,
their running average, moments of the optimisers, and in its JSON head the step) and ``best.safetensors`` (parameters alone).
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from ..errors import CospeechWarning, InputError, nearest
from ..files import atomic, describe_os_error, read_regular, regular_file
from ..limits import RUN_BYTES
from ..models import ENTRIES, NETWORKS
from ..models.nn.trainable import Trainable
from .recipe import Recipe, build, change_recipe, check_types, list_changes
from .renamed import RENAMED, add_former_values

__all__ = [
    "FORMAT",
    "WHICH",
    "build_config",
    "build_model",
    "continue_recipe",
    "load_run",
    "network",
    "read_facts",
    "read_state",
    "read_tensors",
    "stands_for",
    "write_facts",
    "write_tensors",
]

FORMAT = "cospeech-run-1"
WHICH = ("best", "last")


def network(name: str) -> type[Trainable]:
    """The class of a network by its registry name.

    Raises:
        InputError: there is no such network, or its class does not declare its settings.
    """
    if name not in NETWORKS:
        raise InputError(f"no network is called {name!r}", nearest(name, NETWORKS))
    module, _, attribute = NETWORKS[name].partition(":")
    kind = ENTRIES.find_code(name, module, attribute)
    if not (isinstance(kind, type) and issubclass(kind, Trainable)):
        raise InputError(f"{NETWORKS[name]} is no network that trains", f"a subclass of {Trainable.__module__}.Trainable is")
    if not is_dataclass(getattr(kind, "Config", None)):
        hint = "Config = a frozen dataclass, whose fields are the keys of [model] (docs/add_a_model.md)"
        raise InputError(f"{NETWORKS[name]} has no Config", hint)
    check_types(kind.Config)
    return kind


def build_config(name: str, values: Mapping[str, Any]) -> Any:
    """The settings of a network, an instance of its ``Config``.

    Args:
        name: in the registry.
        values: by field; what is left out has its default.

    Raises:
        InputError: no such network, no such setting (the hint names the extension that has it), or a value of the wrong kind.
    """
    kind, more = network(name), f"{name}-extended"
    own = {field.name for field in fields(kind.Config)}
    unknown = {key: {key, *RENAMED.get(key, ())} for key in values if key not in own}
    theirs = {field.name for field in fields(network(more).Config)} if unknown and more in NETWORKS else set()
    if unknown and all(theirs & names for names in unknown.values()):
        key, names = next(iter(unknown.items()))
        hint = f'model.name = "{more}" has it' + ("" if key in theirs else f", as {min(theirs & names)!r}")
        raise InputError(f"the published {name!r} has no key model.{key}", hint)
    return build(kind.Config, values, "model")


def build_model(facts: Mapping[str, Any], needs: Mapping[str, nn.Module] | None = None) -> Trainable:
    """A model with new parameters, from the facts of a run (``model``, ``config``, ``sizes``, ``needs``).

    Args:
        facts: of the run.
        needs: trained models that it takes by keyword; None: new ones from their facts, to be filled from the checkpoint.
    """
    kind = network(facts["model"])
    config = build_config(facts["model"], add_former_values(facts["model"], facts["config"]))
    sizes = {name: facts["sizes"][name] for name in kind.dimensions_for(config) if name in facts["sizes"]}
    parts = {name: build_model(part) for name, part in facts["needs"].items()} if needs is None else needs
    try:
        return kind(config, **sizes, **parts)
    except TypeError as error:
        hint = f"its constructor takes (config, {', '.join(f'{keyword}=' for keyword in {**sizes, **parts})})"
        raise InputError(f"cannot build {facts['model']!r}: {error}"[:200], hint) from None


def write_facts(folder: Path, facts: Mapping[str, Any], files: Mapping[str, Mapping[str, Tensor]]) -> None:
    """Begin a run folder; ``config.json`` is written last, so that a folder with it is complete."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make {str(folder)!r}: {describe_os_error(error)}", "is the name right?") from None
    for name, tensors in files.items():
        write_tensors(folder / f"{name}.safetensors", tensors, {})
    with atomic(folder / "config.json") as path:
        path.write_text(json.dumps({"format": FORMAT, **facts}, indent=1, ensure_ascii=False) + "\n", "utf-8", newline="\n")


def read_facts(folder: Path) -> dict[str, Any]:
    """``config.json`` of a run folder.

    Raises:
        InputError: it is not a run folder.
    """
    path = folder / "config.json"
    try:
        facts = json.loads(read_regular(path, "the facts of a run", RUN_BYTES))
    except (ValueError, RecursionError):  # an `InputError` is a ValueError
        raise InputError(f"{str(folder)!r} is not a run: no readable config.json", "`cospeech train` makes one") from None
    if not isinstance(facts, dict) or facts.get("format") != FORMAT:
        raise InputError(f"{str(folder)!r} is not a run of this version ({FORMAT})", "train it again")
    return facts


def continue_recipe(folder: Path, file: Recipe, overrides: Sequence[str]) -> tuple[Recipe, list[str]]:
    """The recipe with which a run continues: the one that it began with, with the overrides that are given now.

    Args:
        folder: of the run.
        file: the recipe that is named now, with the same overrides.
        overrides: ``"section.key=value"``.

    Returns:
        The recipe, and what differs in the named one and is ignored: ``["train.steps 2000 (the file says 500)"]``.

    Raises:
        InputError: not a run, or one of another model.
    """
    try:
        recipe = change_recipe(read_facts(folder)["recipe"], overrides)
    except (KeyError, TypeError) as error:
        raise InputError(f"the config.json of {str(folder)!r} is damaged: {error!r}"[:200], "train it again") from None
    if recipe.model != file.model:
        hint = "name the recipe that it began with; --out names another folder"
        raise InputError(f"the run {str(folder)!r} is of the model {recipe.model!r}, the recipe of {file.model!r}", hint)
    return recipe, list_changes(recipe.to_dict(), file.to_dict(), ("data.store",), "{} {} (the file says {})")


def write_tensors(path: Path, tensors: Mapping[str, Tensor], state: Mapping[str, Any]) -> None:
    """Write one file, whole or not at all: tensors, and a JSON object in its head."""
    plain = {name: tensor.detach().to("cpu", copy=True).contiguous() for name, tensor in tensors.items()}
    with atomic(path) as temporary:
        save_file(plain, temporary, {"state": json.dumps(state, sort_keys=True)})
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())


def read_tensors(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Tensors, on the CPU, and JSON object of a file of `write_tensors`.

    Raises:
        InputError: there is no such file, or it is damaged.
    """
    with _open_checkpoint(path) as file:
        # Copies: the file stays mapped as long as one of its tensors is used, and Windows replaces no such file.
        return {name: file.get_tensor(name).clone() for name in file.keys()}, _state(file)  # noqa: SIM118  # it is no mapping


def read_state(path: Path) -> dict[str, Any]:
    """The JSON object in the head of a file of `write_tensors`.

    Raises:
        InputError: there is no such file, or it is damaged.
    """
    with _open_checkpoint(path) as file:
        return _state(file)


def _state(file: Any) -> dict[str, Any]:
    state: dict[str, Any] = json.loads((file.metadata() or {}).get("state", "{}"))
    return state


@contextmanager
def _open_checkpoint(path: Path) -> Iterator[Any]:
    try:
        with safe_open(regular_file(path, "a checkpoint"), "pt") as file:
            yield file
    except OSError as error:
        raise InputError(f"cannot read {str(path)!r}: {describe_os_error(error)}", "has the run saved yet?") from None
    except (SafetensorError, ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{str(path)!r} is damaged: {error}"[:200], "train it again") from None


def stands_for(folder: Path, which: str = "best") -> str:
    """The checkpoint that is read for ``which``: "last" instead of "best" where the run stopped before its first validation.

    Raises:
        InputError: no checkpoint has this name, or the run has saved nothing yet.
    """
    if which not in WHICH:
        raise InputError(f"no checkpoint is called {which!r}", nearest(which, WHICH))
    there = {name for name in WHICH if (folder / f"{name}.safetensors").exists()}
    if not there:
        raise InputError(f"the run {str(folder)!r} has saved nothing yet", "`cospeech train --resume` continues it")
    return which if which in there or which == "last" else "last"


def load_run(folder: str | PathLike[str], which: str = "best") -> tuple[Trainable, dict[str, Any]]:
    """A trained model, ready for use on the CPU.

    Args:
        folder: of the run.
        which: "best", by validation, or "last"; both are the running average where the run kept one. A run that stopped before
            its first validation has no best: the last are taken then, and a `CospeechWarning` says so.

    Returns:
        The model in evaluation mode, and the facts of ``config.json``.

    Raises:
        InputError: not a run, nothing saved yet, or its files are damaged.
    """
    facts = read_facts(Path(folder))
    choice, which = which, stands_for(Path(folder), which)
    tensors, state = read_tensors(Path(folder) / f"{which}.safetensors")
    if which != choice:
        note = f"the run {str(folder)!r} was not validated yet: its last parameters are taken, of step {state.get('step')}"
        warnings.warn(note, CospeechWarning, stacklevel=2)
    with torch.random.fork_rng(devices=[]):  # new parameters draw random numbers, not the caller's
        try:
            model = build_model(facts)
        except (KeyError, TypeError, AttributeError) as error:
            raise InputError(f"the config.json of {str(folder)!r} is damaged: {error!r}"[:200], "train it again") from None
    if which == "last":
        average = {n.removeprefix("ema."): t for n, t in tensors.items() if n.startswith("ema.")}
        tensors = {n.removeprefix("model."): t for n, t in tensors.items() if n.startswith("model.")} | average
    try:
        model.load_state_dict(tensors)
    except RuntimeError as error:
        reason = (str(error).splitlines() or [type(error).__name__])[-1].strip()
        problem = f"{which}.safetensors of {str(folder)!r} does not fit the model: {reason}"
        raise InputError(problem[:300], "was it trained with another version?") from None
    return model.eval(), facts
