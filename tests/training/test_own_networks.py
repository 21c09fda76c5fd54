"""Networks of a contributor that break a rule are told which, and where they are to say it."""

from __future__ import annotations

from dataclasses import dataclass, make_dataclass
from typing import Any, Literal

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from torch import nn  # noqa: E402

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.nn.export import ExportGraph  # noqa: E402
from cospeech.models.nn.objective import Objective  # noqa: E402
from cospeech.models.nn.trainable import Trainable  # noqa: E402
from cospeech.models.registry import NETWORKS  # noqa: E402
from cospeech.training.checkpoint import network  # noqa: E402
from cospeech.training.export.onnx_export import export_graphs  # noqa: E402
from cospeech.training.objective_optimiser import ObjectiveOptimiser, list_objectives  # noqa: E402
from cospeech.training.recipe import Optimiser, check_types  # noqa: E402


class Bare(Trainable):
    """A network that defines nothing."""


def test_what_a_network_must_say():
    with pytest.raises(InputError, match=r"Bare does not say what is trained \(docs/add_a_model\.md: objectives\)"):
        list_objectives(Bare())
    with pytest.raises(InputError, match=r"Bare does not say how long a training window is \(self\.config = config"):
        _ = Bare().window

    class Configured(Bare):
        @property
        def config(self):
            return make_dataclass("C", [("frames", int, 7)])()

    assert Configured().window == 7


@pytest.mark.parametrize(
    ("objectives", "message"),
    [([], "gives list"), ({}, "gives {}"), ({"pose": (1, 2)}, r"gives {'pose': \(1, 2\)}"), (None, "NoneType")],
)
def test_objectives_are_named(objectives, message):
    net = Bare()
    net.objectives = lambda: objectives
    with pytest.raises(InputError, match=message):
        list_objectives(net)


def test_a_loss_that_depends_on_nothing_is_told():
    weight = nn.Parameter(torch.ones(2))
    part = ObjectiveOptimiser("pose", Objective([weight], lambda batch, step: {}), Optimiser())
    with pytest.raises(InputError, match="the loss of the objective 'pose' depends on no parameter"):
        part.gradients(weight.detach().sum())
    assert part.gradients((3 * weight).sum())[0].tolist() == [3, 3]


@pytest.mark.parametrize(
    ("graphs", "message"),
    [
        (None, "something else than ExportGraph by name"),
        (nn.Linear(1, 1), "something else than ExportGraph by name"),
        ({"make": nn.Linear(1, 1)}, "something else than ExportGraph by name"),
        ({"mkae": ExportGraph(nn.Linear(1, 1), {}, {})}, "gives 'mkae' .*did you mean 'make'"),
    ],
)
def test_what_is_exported_has_known_names(graphs, message):
    with pytest.raises(InputError, match=message):
        export_graphs(graphs)


@pytest.mark.parametrize(
    ("kind", "message"),
    [(tuple, "C.x is of the type tuple"), (list[int], r"list\[int\]"), (Literal["a"], "Literal"), (dict[str, int], "dict")],
)
def test_a_recipe_cannot_hold_every_type(kind, message):
    with pytest.raises(InputError, match=message):
        check_types(make_dataclass("C", [("x", kind, None)]))


def test_types_that_a_recipe_holds():
    @dataclass
    class Good:
        a: int = 1
        b: float | None = None
        c: tuple[int, ...] = ()
        d: tuple[str, float] | None = None
        e: Any = None
        f: bool = True

    check_types(Good)
    for name in NETWORKS:
        network(name)
