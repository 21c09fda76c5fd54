"""The graphs of networks, played without PyTorch, give what the networks give in PyTorch."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")
onnx = pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.nn.export import ExportGraph  # noqa: E402
from cospeech.runtime.bundles.graph_check import OPERATORS  # noqa: E402
from cospeech.runtime.flow.graph import build_graphs  # noqa: E402
from cospeech.runtime.flow.weights import pack_weights  # noqa: E402
from cospeech.runtime.network import Network  # noqa: E402
from cospeech.training.export import onnx_export, torch_shortcuts  # noqa: E402
from cospeech.training.export.onnx_export import Exported, measure_reach  # noqa: E402
from tests.support.exports import export_graphs  # noqa: E402
from tests.support.runtime_bundles import random_arrays, small_sizes  # noqa: E402
from tests.support.windowed_networks import KINDS, given, make_network, run_network  # noqa: E402
from tests.training.test_chain_onnx_export import QUICK, export_network  # noqa: E402

torch.set_num_threads(1)


@cache
def export(name: str, audio: int = 20) -> tuple[Any, Exported]:
    """A network and its graphs; an export takes seconds."""
    net = make_network(name, audio=audio)
    return net, export_graphs(net.export_module())


def engine_of(low: Exported, name: str = "make") -> Network:
    return Network(low.signatures[name], low.graphs[name], low.weights)


def play(who: Network, rows, style, noise) -> np.ndarray:
    """(N, T, D) poses of N takes."""
    ports = {"rows": rows[None], "style": style, "noise": noise}
    poses = who.run(**{name: x for name, x in ports.items() if name in who.signature.inputs})["poses"]
    return np.broadcast_to(poses, (len(style), *poses.shape[1:]))


def off(poses: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(poses - expected).max())


WIDTHS = [pytest.param("speech2gesture", audio, marks=pytest.mark.slow) for audio in (27, 130)]


@pytest.mark.parametrize(("name", "audio"), [*((name, 20) for name in KINDS), *WIDTHS])
def test_a_graph_makes_what_its_network_makes(name, audio):
    """Widths of speech: padded, with an even and an odd number of bands left at the end, with bands that nothing is made of."""
    net, low = export(name, audio)
    engine = engine_of(low)
    for takes, frames in ((1, 64), (3, 96), (2, 32)):
        inputs = given(net, takes, frames, seed=frames)
        expected = run_network(net, *inputs)
        assert expected.std() > 0.05
        assert off(play(engine, *inputs), expected) <= 1e-5 * max(1, np.abs(expected).max())


class Cell(torch.nn.Module):
    """A network by frames as docs/add_a_model.md allows: speech that all takes share beside a style that each has."""

    def __init__(self) -> None:
        super().__init__()
        self.cell = torch.nn.GRUCell(7, 5)

    def forward(self, rows, style, memory):
        inputs = torch.cat([rows.expand(style.shape[0], -1), style], -1)
        memory = self.cell(inputs, memory)
        return memory, memory


def test_a_frame_of_speech_and_a_style_lie_side_by_side():
    torch.manual_seed(0)
    net = Cell()
    graph = ExportGraph(net, {"rows": (1, 4), "style": ("N", 3)}, {"poses": ("N", 5)}, states={"memory": 5})
    engine = engine_of(export_graphs({"live": graph}), "live")
    rows, style, state = torch.randn(6, 1, 4), torch.randn(2, 3), engine.begin(2)
    memory = torch.zeros(2, 5)
    for row in rows:
        memory = net(row, style, memory)[0].detach()
        output = engine.run(rows=row.numpy(), style=style.numpy(), **state)
        state = {name: output[f"next.{name}"] for name in state}
        assert off(output["poses"], memory.numpy()) < 1e-5


def test_a_fold_that_changes_what_a_network_makes_is_found(monkeypatch):
    def fold_wrongly(net):
        copy = deepcopy(net)
        copy.cell.bias_ih.data += 0.1
        return copy

    graph = ExportGraph(Cell(), {"rows": (1, 4), "style": ("N", 3)}, {"poses": ("N", 5)}, states={"memory": 5})
    monkeypatch.setattr("cospeech.training.export.onnx_export.inference_copy", fold_wrongly)
    with pytest.raises(InputError, match="gives other numbers"):
        export_graphs({"live": graph})


@pytest.mark.filterwarnings("ignore:LSTM with projections is not supported with oneDNN")
@pytest.mark.parametrize("both", [True, False])
@pytest.mark.parametrize("batch_first", [True, False])
def test_shapes_of_recurrent_layers_are_told_as_pytorch_makes_them(batch_first, both):
    """What PyTorch's exporter is told in the place of a loop that it would compile."""
    rows, two = torch.randn(3, 6, 4), 2 * (1 + both)
    takes = 3 if batch_first else 6
    options = {"num_layers": 2, "bidirectional": both, "batch_first": batch_first}
    for net, state, shape in (
        (torch.nn.LSTM(4, 5, **options), (torch.zeros(two, takes, 5),) * 2, torch_shortcuts._shape_lstm),
        (torch.nn.LSTM(4, 5, proj_size=2, **options), (torch.zeros(two, takes, 2), torch.zeros(two, takes, 5)),
         torch_shortcuts._shape_lstm),
        (torch.nn.GRU(4, 5, **options), torch.zeros(two, takes, 5), torch_shortcuts._shape_gru),
    ):  # fmt: skip
        output, after = net(rows, state)
        expected = [output, *(after if isinstance(after, tuple) else [after])]
        shapes = shape(rows, state, [], True, 2, 0.0, False, both, batch_first)
        assert [(x.shape, x.dtype) for x in shapes] == [(x.shape, x.dtype) for x in expected]


def test_a_version_of_pytorch_without_what_is_shortened_takes_its_time(monkeypatch):
    patches = pytest.importorskip("torch.export._patches")
    before = dict(vars(patches))
    more = [("torch.no_such_module", "name", id), ("torch.export", "no_such_name", id)]
    monkeypatch.setattr(torch_shortcuts, "_LONG", [*more, *torch_shortcuts._LONG])
    with torch_shortcuts.shorten_exports():
        assert patches.lstm_while_loop_impl is torch_shortcuts._shape_lstm
    assert vars(patches) == before


@pytest.mark.parametrize("name", KINDS)
def test_takes_do_not_depend_on_each_other(name):
    net, low = export(name)
    engine = engine_of(low)
    rows, style, mode_noise = given(net, 4, 64)
    together = play(engine, rows, style, mode_noise)
    for n in range(4):
        assert off(play(engine, rows, style[n : n + 1], mode_noise[n : n + 1])[0], together[n]) < 1e-5
    assert (off(together[0], together[1]) > 0.01) == bool(net.styles or net.modes)


@pytest.mark.parametrize("name", ["mix-stage", "stage", "munit"])
def test_styles_are_recognised_as_by_the_network(name):
    net, low = export(name)
    engine = engine_of(low, "style")
    rng = np.random.default_rng(0)
    for frames in (64, 77, 130):
        poses = rng.normal(size=(frames, net.pose)).astype(np.float32)
        expected = net.style_of(torch.from_numpy(poses)[None])[0].numpy()
        assert off(engine.run(poses=poses[None])["style"][0], expected) <= 1e-5
        assert expected.std() > 1e-3


@pytest.mark.parametrize("name", ["cmix-gan", "speech2gesture"])
def test_where_there_is_no_style_none_is_recognised(name):
    assert set(export(name)[1].graphs) == {"make"}


@pytest.mark.parametrize("name", KINDS)
def test_the_same_network_gives_the_same_bytes(name):
    """Whatever the machine; nothing in them tells of it."""
    net, low = export(name)
    if name == "speech-to-face":
        assert onnx_export.export_graphs(net.export_module()).graphs == low.graphs
    for graph in low.graphs.values():
        model = onnx.load_from_string(graph)
        assert not model.metadata_props
        assert not any("/" in name for node in model.graph.node for name in (node.name, *node.input, *node.output))
        assert not any(node.doc_string or node.metadata_props for node in model.graph.node)


@pytest.mark.parametrize("name", KINDS)
def test_sizes_are_those_of_the_network(name):
    net, low = export(name)
    signature = low.signatures["make"]
    for port, size in {"poses": net.pose, "rows": net.audio, "style": net.styles, "noise": net.modes}.items():
        assert signature.width(port) == size
    assert (signature.window, signature.multiple) == (net.window, net.multiple)


@pytest.mark.slow
def test_a_graph_weighs_what_the_layers_weigh_that_play():
    """With as many layers as in the paper: neither pose encoder nor discriminator; batch norms are folded into convolutions."""
    net = make_network("mix-stage", pose=96, audio=64, speakers=8, modes=8, channels=32, depth=5, style=10)
    low = export_graphs(net.export_module())
    parts = [net.audio_content, net.unet, net.generators, net.mode_logits, net.style.encoder]
    count = sum(p.numel() for part in parts for m in part.modules() if "Conv" in type(m).__name__ for p in m.parameters())
    assert sum(w.size for w in low.weights.values()) == count + net.style.matrix.numel()
    model = onnx.load_from_string(low.graphs["make"])
    kinds = {node.op_type for node in model.graph.node}
    assert "BatchNormalization" not in kinds
    assert sum(node.op_type == "Conv" for node in model.graph.node) == 8 + 12 + 5 + 7 + 2 + 1


@pytest.mark.parametrize("name", ["mix-stage", "cmix-gan", "speech2gesture"])
@pytest.mark.parametrize("audio", [5, 64])
def test_speech_matters_as_far_as_the_network_reaches_and_no_further(name, audio):
    """By the network itself: which frames of speech move a frame of poses, for every place of it on the grid of halvings."""
    net = make_network(name, audio=audio).double()
    step, reach = net.multiple, measure_reach(net.float().export_module()["make"])
    net = net.double()
    frames = 2 * (-(-reach // step) + 1) * step
    rows, style, mode_noise = (torch.from_numpy(x).double() for x in given(net, 1, frames))
    rows = rows[None].requires_grad_()
    offsets = []
    for frame in range(frames // 2, frames // 2 + step):
        pose = net.make(rows, style, mode_noise)[0, frame]
        (gradient,) = torch.autograd.grad(pose.square().sum(), rows)
        at = gradient[0].abs().sum(-1).nonzero().ravel() - frame
        offsets += [-int(at.min()), int(at.max())]
    assert max(offsets) == reach


def test_a_network_that_normalises_over_time_hears_all_of_a_window():
    assert export("munit")[1].signatures["make"].reach is None


def test_every_operator_that_may_be_in_a_file_is_in_one_of_ours():
    """The list of what runs is as short as it can be."""
    flow, operators = small_sizes("expmap-humanoid", "mel20-prosody"), set()
    graphs = [graph for name in KINDS for graph in export(name)[1].graphs.values()]
    for sizes in (flow, replace(flow, int8=False), replace(flow, oldest=True)):
        graphs += build_graphs(pack_weights(random_arrays(sizes), sizes), sizes).values()
    for name in QUICK:
        graphs += export_network(name).graphs.values()
    for graph in graphs:
        operators |= {node.op_type for node in onnx.load_from_string(graph).graph.node}
    assert operators | {"ConvTranspose", "MatMul"} == OPERATORS  # these two: tests/training/test_sampled_bundles.py
