"""Two processes on halves of a batch come to the parameters of one process on the whole of it.

Where a loss has kinks and the network is deep (the gesture autoencoder), rounding alone parts any two runs after some steps,
so that it is not among them; its first steps agree.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="training needs torch (cospeech[train])")

from cospeech.errors import InputError  # noqa: E402
from cospeech.models import ENTRIES  # noqa: E402
from cospeech.models.nn.norm import BatchNorm1d, batch_norm, global_moments  # noqa: E402
from cospeech.training.checkpoint import load_run, read_tensors  # noqa: E402
from cospeech.training.processes import Team, average, mean_values  # noqa: E402
from cospeech.training.recipe import read_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402
from tests.support import tiny_models  # noqa: E402
from tests.support.tiny_store import make_store  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
WORKER = [sys.executable, "-m", "tests.support.train_worker"]
TRAIN = {"steps": 20, "batch": 12, "log_every": 1, "validate_every": 10, "validate_batches": 2, "save_every": 10, "threads": 1}
FLOW = {
    "steps": 2, "hidden": 8, "layers": 1, "history": 4, "frames": 8, "encoder_channels": 4, "encoder_blocks": 1, "feature": 4,
}  # fmt: skip
CONFIGS = {
    "tiny-flow": {},
    "tiny-gan": {},
    "tiny-cascade": {},
    "stylised-flow": FLOW,
}


def recipe(name, **settings):
    own = {**TRAIN, "clip_value": 5.0, "clip_norm": 1.0, "ema": 0.9, **settings}
    return {"model": {"name": name, **CONFIGS[name]}, "train": own}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("together")


@pytest.fixture(scope="module")
def store(place):
    return make_store(place / "store")


@pytest.fixture(scope="module")
def together(place, store):
    """Folder of the runs that two processes have done, each named as its model."""
    jobs = [{"recipe": recipe(name), "store": str(store), "out": str(place / name)} for name in CONFIGS]
    jobs += [{"recipe": recipe("tiny-gan", steps=5), "store": str(store), "out": str(place / "resumed")}]
    jobs += [{"recipe": recipe("tiny-gan"), "store": str(store), "out": str(place / "resumed"), "resume": True}]
    work = {"jobs": jobs, "size": 2, "meet": str(place / "meet")}
    team = [
        subprocess.Popen([*WORKER, json.dumps(work | {"rank": rank})], cwd=ROOT, stderr=subprocess.PIPE, text=True)
        for rank in range(2)
    ]
    errors = [process.communicate(timeout=200)[1] for process in team]
    assert [process.returncode for process in team] == [0, 0], "\n".join(errors)
    return place


@pytest.fixture(autouse=True)
def _register_models(monkeypatch):
    for name, entry in tiny_models.MODELS.items():
        monkeypatch.setitem(ENTRIES.ours, name, entry)


def log(folder):
    return [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]


@pytest.mark.parametrize("name", CONFIGS)
def test_two_processes_train_as_one(together, store, tmp_path, name):
    train(read_recipe(recipe(name)), store, tmp_path / "alone")
    one, _ = read_tensors(tmp_path / "alone" / "last.safetensors")
    two, _ = read_tensors(together / name / "last.safetensors")
    start = train(read_recipe(recipe(name, steps=1, lr=0.0)), store, tmp_path / "begun").folder
    new = load_run(start, "last")[0].state_dict()
    assert set(one) == set(two)
    weights = [key for key in one if key.startswith(("model.", "ema."))]
    differences = {key: (one[key].double() - two[key].double()).abs().max().item() for key in weights}
    assert max(differences.values()) <= 1e-5, max(differences, key=differences.get)
    distance = max((one[f"model.{key}"].double() - value.double()).abs().max().item() for key, value in new.items())
    assert distance > 1e-3  # else there was nothing to agree upon
    for first, second in zip(log(tmp_path / "alone"), log(together / name), strict=True):
        assert first["step"] == second["step"]
        for kind in ("loss", "gradient", "rate", "validation"):
            assert first.get(kind, {}) == pytest.approx(second.get(kind, {}), rel=1e-3, abs=1e-5)


def test_they_resume_together(together):
    first, second = ((together / name / "last.safetensors").read_bytes() for name in ("tiny-gan", "resumed"))
    assert first == second


def test_a_batch_that_cannot_be_shared_is_told(store, tmp_path, monkeypatch):
    from cospeech.training import train as module

    monkeypatch.setattr(module, "join", lambda device: _nobody(Team(0, 5, torch.device("cpu"))))
    with pytest.raises(InputError, match="a batch of 12 for 5 processes"):
        train(read_recipe(recipe("tiny-gan")), store, tmp_path / "run")


class _nobody:
    def __init__(self, team):
        self.team = team

    def __enter__(self):
        return self.team

    def __exit__(self, *error):
        return None


# alone ------------------------------------------------------------------------------------------------------------------


def test_alone_the_norm_is_that_of_pytorch():
    ours, theirs = BatchNorm1d(5), torch.nn.BatchNorm1d(5)
    assert list(ours.state_dict()) == list(theirs.state_dict())
    x = torch.randn(4, 5, 7, generator=torch.Generator().manual_seed(1)) * 3 + 2
    assert torch.equal(ours(x), theirs(x))
    assert torch.equal(ours.running_var, theirs.running_var)
    assert torch.equal(ours.eval()(x), theirs.eval()(x))


def test_the_norm_over_processes_is_that_of_pytorch_over_all(monkeypatch):
    """The same sums by our own code, in a team of one that does not know it."""
    from cospeech.models.nn import norm

    monkeypatch.setattr(norm, "is_shared", lambda: True)
    monkeypatch.setattr(norm.dist, "all_reduce", lambda tensor: None)
    for momentum in (0.1, None):
        ours, theirs = BatchNorm1d(5, momentum=momentum), torch.nn.BatchNorm1d(5, momentum=momentum)
        for seed in range(3):
            x = torch.randn(4, 5, 7, generator=torch.Generator().manual_seed(seed)) * 3 + 2
            a, b = x.clone().requires_grad_(), x.clone().requires_grad_()
            (ours(a) ** 3).sum().backward()
            (theirs(b) ** 3).sum().backward()
            torch.testing.assert_close(ours(x), theirs(x), atol=1e-5, rtol=1e-5)
            torch.testing.assert_close(batch_norm(x, ours.weight, ours.bias), ours(x), atol=1e-5, rtol=1e-5)
            theirs(x)
            torch.testing.assert_close(a.grad, b.grad, atol=1e-3, rtol=1e-4)
        for key, value in ours.state_dict().items():
            torch.testing.assert_close(value, theirs.state_dict()[key], atol=1e-5, rtol=1e-5)


def test_moments_are_those_of_the_whole_batch():
    x = torch.randn(6, 9, 3, generator=torch.Generator().manual_seed(1)) + 1000
    mean, std = global_moments(x, (0, 1))
    torch.testing.assert_close(mean, x.double().mean((0, 1)).float())
    torch.testing.assert_close(std, x.double().std((0, 1), unbiased=False).float(), atol=1e-4, rtol=1e-4)
    assert global_moments(x.bfloat16(), (0,))[0].dtype == torch.float32


def test_gradients_are_sent_in_buckets_and_put_back(monkeypatch):
    from cospeech.training import processes

    sizes = []
    monkeypatch.setattr(processes, "BUCKET", 10)
    monkeypatch.setattr(processes.dist, "all_reduce", lambda flat: sizes.append(flat.numel()) or flat.mul_(4))
    tensors = [torch.full((n,), float(n)) for n in (4, 5, 3, 20, 1)] + [torch.ones(2, 2, dtype=torch.float64)]
    expected = [tensor * 2 for tensor in tensors]
    team = Team(0, 2, torch.device("cpu"))
    average(tensors, team)
    assert sizes == [9, 3, 20, 1, 4]
    assert all(torch.equal(a, b) for a, b in zip(tensors, expected, strict=True))
    assert mean_values([torch.tensor(1.5), 2], team) == [3.0, 4.0]


def test_torchrun_trains(store, tmp_path):
    """As the manual tells it, on the command line, with a network that is registered."""
    (tmp_path / "x.toml").write_text(
        '[model]\nname = "gesture-autoencoder"\nframes = 32\nwidth = 8\n'
        "[train]\nsteps = 4\nbatch = 8\nvalidate_every = 2\nvalidate_batches = 1\nthreads = 1\n"
    )
    command = [
        sys.executable,
        "-m",
        "torch.distributed.run",
        "--standalone",
        "--nproc-per-node",
        "2",
        "-m",
        "cospeech",
        "train",
    ]
    command += [str(tmp_path / "x.toml"), "--store", str(store), "--out", str(tmp_path / "run")]
    result = subprocess.run(command, capture_output=True, text=True, timeout=200, env=os.environ | {"OMP_NUM_THREADS": "1"})
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("4 steps") == 1  # one of them speaks
    assert read_tensors(tmp_path / "run" / "last.safetensors")[1]["step"] == 4
