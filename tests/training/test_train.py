"""The training loop: it learns, it can be killed at any moment and goes on as if nothing had been, it says what is wrong."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch (cospeech[train])")

from cospeech.corpora.store import Store  # noqa: E402
from cospeech.errors import CospeechError, CospeechWarning, InputError  # noqa: E402
from cospeech.models import ENTRIES  # noqa: E402
from cospeech.training.batch_loader import POSE_FLOOR, standard_audio, standard_pose  # noqa: E402
from cospeech.training.checkpoint import load_run, read_facts, read_tensors, write_tensors  # noqa: E402
from cospeech.training.feature_networks import load_features  # noqa: E402
from cospeech.training.recipe import Optimiser, read_recipe  # noqa: E402
from cospeech.training.schedule import SCHEDULES  # noqa: E402
from cospeech.training.train import train  # noqa: E402
from cospeech.training.windows import Windows  # noqa: E402
from tests.support import tiny_models  # noqa: E402
from tests.support.leftovers import make_leftover  # noqa: E402
from tests.support.tiny_store import POSE, make_store  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
WORKER = [sys.executable, "-m", "tests.support.train_worker"]
TINY = sorted(tiny_models.MODELS)


@pytest.fixture(autouse=True)
def _register_models(monkeypatch):
    for name, entry in tiny_models.MODELS.items():
        monkeypatch.setitem(ENTRIES.ours, name, entry)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return make_store(tmp_path_factory.mktemp("store") / "tiny")


def plan(model="tiny-flow", *, config=None, data=None, needs=None, **settings):
    """Sections of a small recipe."""
    own = {"steps": 20, "batch": 12, "log_every": 1, "validate_every": 10, "save_every": 5, "threads": 1, "validate_batches": 2}
    return {"model": {"name": model, **(config or {})}, "needs": needs or {}, "data": data or {}, "train": own | settings}


def run(sections, store, out, **options):
    return train(read_recipe(sections), store, out, **options)


@pytest.fixture(scope="module")
def runs_with_an_end(store, tmp_path_factory):
    """Runs that a signal ended: name → exit code and folder."""
    place = tmp_path_factory.mktemp("ended")
    jobs = {name: {"recipe": killable(name), "die": 13} for name in TINY}
    jobs["interrupted"] = {"recipe": plan(save_every=100), "interrupt": 7}
    work = [job | {"store": str(store), "out": str(place / name)} for name, job in jobs.items()]
    command = [*WORKER, json.dumps({"jobs": work})]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=200)
    assert result.returncode == 0, result.stderr
    return {name: (code, place / name) for name, code in zip(jobs, json.loads(result.stdout), strict=True)}


def killable(model):
    return plan(model, ema=0.9, schedule="noam", warmup=8)


def log(folder):
    """Rows of a log, without times."""
    rows = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    return [{key: value for key, value in row.items() if key not in ("seconds", "windows_per_second")} for row in rows]


# learning ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", TINY)
def test_it_learns(store, tmp_path, model):
    best = "made.near" if model == "tiny-gan" else ""
    report = run(plan(model, steps=60, lr=0.01, best=best, validate_every=5), store, tmp_path / "run")
    rows = [row["validation"] for row in log(tmp_path / "run") if "validation" in row]
    name = report.best["name"]
    values = [row[name] for row in rows if name in row]
    assert min(values) < 0.9 * values[0] if values[0] > 0 else min(values) < values[0]
    assert report.best["value"] == min(values)
    assert (report.step, report.resumed, report.rank) == (60, 0, 0)


def test_only_the_parameters_of_an_objective_move(store, tmp_path):
    """A cascade: the first stage rests when the second has begun, which before had not moved."""
    run(plan("tiny-cascade", steps=10), store, tmp_path / "run")
    first, _ = load_run(tmp_path / "run", "last")
    run(plan("tiny-cascade", steps=15), store, tmp_path / "run", resume=True)
    second, _ = load_run(tmp_path / "run", "last")
    run(plan("tiny-cascade", steps=1, lr=0.0), store, tmp_path / "none")
    start, _ = load_run(tmp_path / "none", "last")
    for name, before in first.named_parameters():
        is_second = name.startswith("heard")
        assert torch.equal(before, second.get_parameter(name)) != is_second, name
        assert torch.equal(before, start.get_parameter(name)) == is_second, name


def test_best_begins_anew_with_the_next_stage(store, tmp_path):
    report = run(plan("tiny-cascade", steps=20, validate_every=5), store, tmp_path / "run")
    assert report.best["name"] == "heard"
    assert report.best["step"] > 10


def test_every_term_is_in_the_log_though_not_in_every_step(store, tmp_path):
    run(plan("tiny-gan", log_every=10), store, tmp_path / "run")
    rows = [row for row in log(tmp_path / "run") if "loss" in row]
    assert [row["step"] for row in rows] == [10, 20]
    assert set(rows[0]["loss"]) == {
        "discriminator",
        "discriminator.real",
        "discriminator.made",
        "made",
        "made.near",
        "made.generator_loss",
    }
    assert rows[0]["loss"]["discriminator"] == pytest.approx(
        rows[0]["loss"]["discriminator.real"] + rows[0]["loss"]["discriminator.made"]
    )
    assert rows[0]["rate"] == {"discriminator": 1e-3, "made": 1e-3}
    assert all(size > 0 for size in rows[0]["gradient"].values())


def test_figures_of_all_steps_compare(store, tmp_path, monkeypatch):
    """A term that is due in every fifth step is in every validation."""
    plain = tiny_models.TinyFlow.loss

    def with_rare(model, batch, step):
        rare = {} if step % 5 else {"rare": model.flow.steps[0].norm.bias.sum()}
        return plain(model, batch, step) | rare

    monkeypatch.setattr(tiny_models.TinyFlow, "loss", with_rare)
    run(plan(steps=12, validate_every=4, log_every=6), store, tmp_path / "run")
    rows = log(tmp_path / "run")
    assert all("flow.rare" in row["validation"] for row in rows if "validation" in row)
    assert all("flow.rare" in row["loss"] for row in rows if "loss" in row)


def test_an_objective_has_its_own_rate(store, tmp_path):
    sections = plan("tiny-gan", steps=2, discriminator={"lr": 0.5, "schedule": "exponential", "gamma": 0.1})
    run(sections, store, tmp_path / "run")
    rates = [row["rate"] for row in log(tmp_path / "run") if "rate" in row]
    assert rates[0] == {"discriminator": 0.5, "made": 1e-3}
    assert rates[1]["discriminator"] == pytest.approx(0.05)
    with pytest.raises(InputError, match=r"no objective 'discrimnator' in \[train\] \(did you mean 'discriminator'"):
        run(plan("tiny-gan", discrimnator={"lr": 0.5}), store, tmp_path / "other")


def test_clipping_is_by_value_then_by_norm(store, tmp_path):
    """Adam cannot tell the scale of a gradient; with betas of nearly 0 and a large eps a step is lr · g / eps."""
    step = {"steps": 1, "lr": 1e6, "betas": [0.0, 0.0], "eps": 1e6}
    steps = {}
    for name, clipping in {"no": {}, "value": {"clip_value": 0.01}, "both": {"clip_value": 0.01, "clip_norm": 0.02}}.items():
        run(plan("tiny-cascade", **step, **clipping), store, tmp_path / name)
        run(plan("tiny-cascade", **{**step, "lr": 0.0}), store, tmp_path / f"{name}-still")
        a, b = load_run(tmp_path / name, "last")[0], load_run(tmp_path / f"{name}-still", "last")[0]
        steps[name] = torch.cat([(p - q).flatten() for p, q in zip(a.parameters(), b.parameters(), strict=True)])
    assert steps["no"].abs().max() > 0.02
    torch.testing.assert_close(steps["value"], steps["no"].clamp(-0.01, 0.01), atol=1e-5, rtol=1e-3)
    torch.testing.assert_close(steps["both"], steps["value"] * 0.02 / steps["value"].norm(), atol=1e-5, rtol=1e-2)


def test_schedules():
    rate = Optimiser(lr=1e-3, warmup=100, floor=1e-4)
    values = [SCHEDULES["noam"](rate, step) for step in range(20_000)]
    assert np.argmax(values) == 99
    assert values[99] == pytest.approx(1e-3)
    assert values[0] == pytest.approx(1e-5)
    assert values[399] == pytest.approx(5e-4)
    assert values[-1] == 1e-4
    rate = Optimiser(lr=1.0, gamma=0.5, gamma_every=10, floor=0.2)
    assert [SCHEDULES["exponential"](rate, step) for step in (0, 9, 10, 20, 30, 90)] == [1, 1, 0.5, 0.25, 0.2, 0.2]
    assert SCHEDULES["constant"](rate, 77) == 1.0


def test_the_running_average_is_what_is_kept_as_best(store, tmp_path):
    report = run(plan(ema=0.99, lr=0.01, validate_every=20), store, tmp_path / "run")
    best, last = load_run(tmp_path / "run")[0].state_dict(), load_run(tmp_path / "run", "last")[0].state_dict()
    tensors, _ = read_tensors(tmp_path / "run" / "last.safetensors")
    name = "flow.steps.0.coupling.net.out.weight"
    assert report.best["step"] == 20
    assert torch.equal(best[name], last[name])
    assert torch.equal(best[name], tensors[f"ema.{name}"])
    assert not torch.equal(best[name], tensors[f"model.{name}"])


def test_half_precision_trains_too(store, tmp_path):
    report = run(plan("tiny-gan", precision="bfloat16", best="made"), store, tmp_path / "run")
    assert report.best["value"] < 2
    assert load_run(tmp_path / "run")[0].decode.weight.dtype == torch.float32


def test_a_processor_without_half_precision_is_told(store, tmp_path, monkeypatch):
    def refuse(*arguments):
        raise RuntimeError("could not create a primitive descriptor for the LSTM forward propagation primitive")

    monkeypatch.setattr("cospeech.training.train.ObjectiveOptimiser.terms", refuse)
    with pytest.raises(InputError, match=r"in bfloat16 \(set train.precision=float32"):
        run(plan("tiny-gan", precision="bfloat16"), store, tmp_path / "run")
    with pytest.raises(RuntimeError, match="could not create a primitive"):  # it is another fault then
        run(plan("tiny-gan"), store, tmp_path / "whole")


def test_tensorboard_gets_the_same_figures(store, tmp_path):
    pytest.importorskip("tensorboard", reason="needs TensorBoard (cospeech[train])")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    run(plan(steps=4, validate_every=2, tensorboard=True), store, tmp_path / "run")
    board = EventAccumulator(str(tmp_path / "run" / "tensorboard"))
    board.Reload()
    losses = {event.step: event.value for event in board.Scalars("loss/flow.nll")}
    expected = {row["step"]: row["loss"]["flow.nll"] for row in log(tmp_path / "run") if "loss" in row}
    assert losses == pytest.approx(expected)
    assert [event.step for event in board.Scalars("validation/flow")] == [2, 4]


def test_nobody_outside_notices(store, tmp_path):
    torch.random.manual_seed(5)
    expected, threads = torch.rand(3), torch.get_num_threads()
    torch.random.manual_seed(5)
    run(plan(steps=2), store, tmp_path / "run")
    load_run(tmp_path / "run", "last")
    assert torch.equal(torch.rand(3), expected)
    assert torch.get_num_threads() == threads


# going on ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", TINY)
def test_killed_and_resumed_it_is_the_run_that_was_not(runs_with_an_end, store, tmp_path, model):
    code, folder = runs_with_an_end[model]
    assert code == -9
    assert read_tensors(folder / "last.safetensors")[1]["step"] == 10
    assert max(row["step"] for row in log(folder)) == 13  # what the log says of steps that are lost will be taken back
    left = make_leftover(folder)
    (left / "0.safetensors").write_bytes(b"half a file")
    with (folder / "log.jsonl").open("a") as file:
        file.write('{"step": 14, "lo')
    straight = run(killable(model), store, tmp_path / "straight")
    report = run(killable(model), store, folder, resume=True)
    assert (report.resumed, report.best) == (10, straight.best)
    for name in ("last.safetensors", "best.safetensors"):
        assert (tmp_path / "straight" / name).read_bytes() == (folder / name).read_bytes(), name
    assert log(tmp_path / "straight") == log(folder)
    assert not left.exists()


def test_interrupted_it_saves_first(runs_with_an_end, store, tmp_path):
    code, folder = runs_with_an_end["interrupted"]
    assert code == 130
    assert read_tensors(folder / "last.safetensors")[1]["step"] == 7
    run(plan(save_every=100), store, tmp_path / "straight")
    assert run(plan(save_every=100), store, folder, resume=True).resumed == 7
    assert (tmp_path / "straight" / "last.safetensors").read_bytes() == (folder / "last.safetensors").read_bytes()


SHARES = (0.1, 0.5, 0.9)


@pytest.fixture(scope="module")
def slow_runs(store, tmp_path_factory):
    """Runs that were interrupted after a share of a slow step: share → exit code, folder and what was told."""
    recipe = plan("tiny-gan", steps=6, ema=0.9, save_every=100, validate_every=3, best="made")
    places = {share: tmp_path_factory.mktemp("slowly") for share in SHARES}
    job = {"recipe": recipe, "store": str(store), "slow": 24, "slow_after": 2}
    jobs = [
        job | {"out": str(place / "run"), "share": share, "told": str(place / "told.json")} for share, place in places.items()
    ]
    command = [*WORKER, json.dumps({"jobs": jobs})]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=200)
    assert result.returncode == 0, result.stderr
    codes = zip(places.items(), json.loads(result.stdout), strict=True)
    return recipe, {share: (code, at / "run", json.loads((at / "told.json").read_text())) for (share, at), code in codes}


@pytest.mark.parametrize("share", SHARES)
def test_interrupted_within_a_slow_step_it_ends_at_once_and_goes_on_as_if_nothing_had_been(slow_runs, store, tmp_path, share):
    """In the forward or the backward pass of either objective of a GAN, one of which moves its parameters before the other."""
    recipe, (code, folder, (step, until, notices)) = slow_runs[0], slow_runs[1][share]
    assert code == 130
    assert until < 0.5 * step
    assert notices[0].startswith("stopping; ")
    assert notices[1:] == ["saved at step 2: --resume goes on"]
    assert read_tensors(folder / "last.safetensors")[1]["step"] == 2
    straight = run(recipe, store, tmp_path / "straight")
    report = run(recipe, store, folder, resume=True)
    assert (report.resumed, report.best) == (2, straight.best)
    for name in ("last.safetensors", "best.safetensors"):
        assert (tmp_path / "straight" / name).read_bytes() == (folder / name).read_bytes(), name
    assert log(tmp_path / "straight") == log(folder)


@pytest.mark.parametrize("where", ["setup", "first step", "second step", "validation", "save"])
def test_wherever_it_is_interrupted_it_goes_on(store, tmp_path, monkeypatch, where):
    """The signal of Ctrl-C comes in the middle; the run that goes on ends like the run that was not stopped."""
    recipe, calls = plan("tiny-gan", steps=6, validate_every=3, save_every=100, ema=0.9, best="made"), []
    place = {"setup": "build_model", "save": "write_tensors"}.get(where)
    target = (
        f"cospeech.training.train.{place}"
        if place
        else f"tests.support.tiny_models.TinyGan.{'generator_loss' if where == 'validation' else 'discriminator_loss'}"
    )
    plain = (
        getattr(import_module("cospeech.training.train"), place)
        if place
        else getattr(tiny_models.TinyGan, target.split(".")[-1])
    )
    due = {"first step": 1, "second step": 2, "validation": 3, "setup": 1, "save": 1}[where]

    def interrupting(*arguments):
        calls.append(1)
        if len(calls) == due:
            signal.raise_signal(signal.SIGINT)
        return plain(*arguments)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with monkeypatch.context() as patch:
            patch.setattr(target, interrupting)
            with pytest.raises(KeyboardInterrupt):
                run(recipe, store, tmp_path / "run", notice=calls.append)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    steps = {"second step": 2, "validation": 2, "save": 2}.get(where, 0)  # quick steps are ended first
    last = f"saved at step {steps}: --resume goes on" if steps else "no step was done yet: there is nothing to save"
    assert calls[-1] == last
    straight, second = run(recipe, store, tmp_path / "straight"), run(recipe, store, tmp_path / "run", resume=True)
    assert (second.resumed, second.best) == (steps, straight.best)
    for name in ("last.safetensors", "best.safetensors"):
        assert (tmp_path / "straight" / name).read_bytes() == (tmp_path / "run" / name).read_bytes(), name
    assert log(tmp_path / "straight") == log(tmp_path / "run")


@pytest.mark.parametrize("way", ["load", "needs", "features"])
def test_a_run_without_a_validation_yet_has_its_last_parameters(store, tmp_path, way):
    run(plan("tiny-cascade", steps=4, validate_every=100), store, tmp_path / "run")
    (tmp_path / "run" / "best.safetensors").unlink()  # as a run that is stopped in step 5 has it
    states = []

    def open_it():
        if way == "load":
            states.append(load_run(tmp_path / "run")[0].state_dict())
        elif way == "features":
            with pytest.raises(InputError, match="no feature network"):  # it was opened
                load_features(tmp_path / "run")
        else:
            with pytest.raises(InputError, match="omega"):  # it was opened: the model takes no such
                run(plan(needs={"omega": str(tmp_path / "run")}), store, tmp_path / "other")

    with pytest.warns(CospeechWarning, match=r"was not validated yet: its last parameters are taken, of step 4"):
        open_it()
    last = load_run(tmp_path / "run", "last")[0].state_dict()
    assert all(torch.equal(value, last[name]) for state in states for name, value in state.items())
    (tmp_path / "run" / "last.safetensors").unlink()
    with pytest.raises(InputError, match="has saved nothing yet"):
        load_run(tmp_path / "run")


def test_a_run_may_grow(store, tmp_path):
    run(plan(steps=30), store, tmp_path / "straight")
    run(plan(steps=20), store, tmp_path / "grown")
    assert run(plan(steps=30), store, tmp_path / "grown", resume=True).resumed == 20
    first, second = (load_run(tmp_path / name, "last")[0].state_dict() for name in ("straight", "grown"))
    assert all(torch.equal(first[name], second[name]) for name in first)
    again = run(plan(steps=30), store, tmp_path / "grown", resume=True)
    assert (again.resumed, again.step) == (30, 30)
    before = (tmp_path / "grown" / "config.json").read_bytes()
    with pytest.raises(InputError, match=r"grown' has 30 steps already \(set more train\.steps\)"):
        run(plan(steps=20), store, tmp_path / "grown", resume=True)
    assert (tmp_path / "grown" / "config.json").read_bytes() == before


def test_a_run_whose_first_stages_were_counted_in_another_way_is_told(store, tmp_path, monkeypatch):
    tiny = tiny_models.TinyFlow
    run(plan(steps=4), store, tmp_path / "run")
    monkeypatch.setattr(tiny, "preliminary_steps", 3)
    with pytest.raises(InputError, match="first stages had 0 uncounted steps, and have 3 now"):
        run(plan(steps=6), store, tmp_path / "run", resume=True)
    assert run(plan(steps=4), store, tmp_path / "other").step == 7
    path = tmp_path / "other" / "last.safetensors"
    tensors, state = read_tensors(path)
    assert (state["step"], state.pop("preliminary_steps")) == (4, 3)
    write_tensors(path, tensors, state)  # as runs were saved before
    assert run(plan(steps=5), store, tmp_path / "other", resume=True).resumed == 7
    write_tensors(path, tensors, state)
    monkeypatch.setattr("cospeech.training.train.Sampled", tiny)
    with pytest.raises(InputError, match="its first stages had 0 uncounted steps"):
        run(plan(steps=6), store, tmp_path / "other", resume=True)


def test_a_store_of_which_nothing_is_left_to_train_on_is_told(tmp_path):
    single = make_store(tmp_path / "single", alone=True)
    with pytest.raises(InputError, match=r"data\.validation holds all clips out: leave it out"):
        run(plan(steps=2, data={"validation": 0.05}), single, tmp_path / "run")


def test_a_run_goes_on_as_it_began(store, tmp_path):
    run(plan(steps=5), store, tmp_path / "run")
    with pytest.raises(InputError, match="there is a run in"):
        run(plan(steps=5), store, tmp_path / "run")
    for sections, what in (
        (plan(steps=5, lr=0.5), r"train.lr: 0.001, now 0.5"),
        (plan(steps=5, config={"hidden": 4}), r"model.hidden: nothing, now 4"),
        (plan("tiny-gan", steps=5), r"model.name: 'tiny-flow', now 'tiny-gan'"),
        (plan(steps=5, config={"hidden": 8}), r"model.hidden: nothing, now 8"),
    ):
        with pytest.raises(InputError, match=what):
            run(sections, store, tmp_path / "run", resume=True)
    other = make_store(tmp_path / "other", mirrored=True)
    with pytest.raises(InputError, match=r"sizes\.speakers: 3, now 4, and"):
        run(plan(steps=5), other, tmp_path / "run", resume=True)


@pytest.mark.parametrize("damage", [b"", b"\x10\0\0\0\0\0\0\0{}", b"\xff" * 100])
def test_a_damaged_checkpoint_is_told(store, tmp_path, damage):
    run(plan(steps=2), store, tmp_path / "run")
    (tmp_path / "run" / "last.safetensors").write_bytes(damage)
    with pytest.raises(InputError, match=r"last\.safetensors"):
        run(plan(steps=4), store, tmp_path / "run", resume=True)
    with pytest.raises(InputError, match=r"last\.safetensors"):
        load_run(tmp_path / "run", "last")
    write_tensors(tmp_path / "run" / "last.safetensors", {"model.x": torch.zeros(2)}, {"step": 1})
    with pytest.raises(InputError, match="cannot go on"):
        run(plan(steps=4), store, tmp_path / "run", resume=True)
    (tmp_path / "run" / "config.json").write_text('{"format": "cospeech-run-1"}')
    with pytest.raises(InputError, match="damaged"):
        load_run(tmp_path / "run")
    with pytest.raises(InputError, match="not a run"):
        load_run(tmp_path)


# what goes wrong --------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not Path("/proc/self/maps").is_file(), reason="tells what this process has mapped")
def test_tensors_of_a_checkpoint_do_not_keep_it_mapped(tmp_path):
    """Windows replaces no file that is mapped: a run that goes on could not save."""
    path = tmp_path / "last.safetensors"
    write_tensors(path, {"x": torch.arange(5000.0)}, {"step": 1})
    tensors, _ = read_tensors(path)
    assert str(path) not in Path("/proc/self/maps").read_text("utf-8")
    assert torch.equal(tensors["x"], torch.arange(5000.0))


def test_a_loss_that_is_no_number_ends_the_run(store, tmp_path):
    with pytest.raises(CospeechError, match=r"'nll' of the objective 'flow' is nan in step 13"):
        run(plan(config={"break_at": 12}), store, tmp_path / "run")
    parameters, state = read_tensors(tmp_path / "run" / "last.safetensors")
    assert state["step"] == 10
    assert all(torch.isfinite(value).all() for value in parameters.values())


@pytest.mark.parametrize(
    ("sections", "says"),
    [
        (plan("tiny-fow"), "no network is called 'tiny-fow' (did you mean 'tiny-flow'?"),
        (plan(config={"hiden": 3}), "no key model.hiden (did you mean 'hidden'?"),
        (plan(config={"hidden": "x"}), "model.hidden is 'x'"),
        (plan(schedule="naom"), "no schedule is called 'naom' (did you mean 'noam'?"),
        (plan(best="flwo"), "train.best is 'flwo' (did you mean 'flow'?"),
        (plan(data={"corpus": "ted"}), "the recipe is for corpus 'ted'"),
        (plan(data={"fps": 20}), "the recipe is for fps 20.0"),
        (plan(data={"fps": 20, "pose": "euler"}), "RAW STORE --pose euler --fps 20` makes one that fits; or set data.pose"),
        (plan(data={"mirror": True}), "has no mirrored clips (prepare it with --mirror)"),
        (plan(data={"audio": "mel28"}), "no reduction of audio is called 'mel28'"),
        (plan(config={"frames": 4000}), "no window of 4000 frames in the train split"),
        (plan(device="abacus"), "no device 'abacus'"),
        (plan(needs={"omega": "nowhere"}), "the run 'nowhere', which is not there"),
    ],
)
def test_what_does_not_fit_is_told(store, tmp_path, sections, says):
    with pytest.raises(InputError) as error:
        run(sections, store, tmp_path / "run")
    assert says in str(error.value)


@pytest.mark.parametrize(
    ("loss", "says"),
    [
        (lambda net, batch, step: net.flow.log_prob(batch["pose"], batch["audio"]).mean(), "'flow' gives a Tensor (a dict of"),
        (lambda net, batch, step: {}, "'flow' gives a {} (a dict of terms"),
        (lambda net, batch, step: {"near": batch["pose"]}, "'flow' gives a {'near': tensor("),
        (lambda net, batch, step: {"near": 1.0}, "'flow' gives a {'near': 1.0}"),
        (lambda net, batch, step: {"near": batch["face"].mean()}, "a batch has no 'face' (it holds audio, clip, pose, speaker"),
    ],
)
def test_a_loss_that_breaks_the_contract_is_told(store, tmp_path, monkeypatch, loss, says):
    monkeypatch.setattr(tiny_models.TinyFlow, "loss", loss)
    with pytest.raises(InputError) as error:
        run(plan(), store, tmp_path / "run")
    assert says in str(error.value)


def test_a_figure_of_a_later_stage_says_what_is_best_from_then_on(store, tmp_path):
    report = run(plan("tiny-cascade", best="heard", steps=20, validate_every=5), store, tmp_path / "run")
    assert report.best["name"] == "heard"
    assert report.best["step"] > 10
    early = run(plan("tiny-cascade", best="codes", steps=20, validate_every=5), store, tmp_path / "early")
    assert early.best["step"] <= 10


def test_needs_that_the_model_does_not_take(store, tmp_path):
    run(plan("tiny-cascade", steps=1), store, tmp_path / "part")
    with pytest.raises(InputError, match=r"unexpected keyword argument 'omega'"):
        run(plan(needs={"omega": str(tmp_path / "part")}), store, tmp_path / "run")


def test_without_a_validation_split(tmp_path):
    store = make_store(tmp_path / "store", validation=False)
    with pytest.raises(InputError, match="in the validation split"):
        run(plan(), store, tmp_path / "run")
    assert run(plan(validate_every=0), store, tmp_path / "none").best is None
    best, last = load_run(tmp_path / "none")[0].state_dict(), load_run(tmp_path / "none", "last")[0].state_dict()
    assert all(torch.equal(best[name], last[name]) for name in best)
    assert run(plan(data={"validation": 0.3}), store, tmp_path / "held").best is not None


# what is fed ------------------------------------------------------------------------------------------------------------


def test_windows_are_a_function_of_seed_and_step(store):
    contents = Store(store)
    first, second = (Windows(contents, 10).at(64, 3, 7) for _ in range(2))
    np.testing.assert_array_equal(first["pose"], second["pose"])
    assert not np.array_equal(first["start"], Windows(contents, 10).at(64, 3, 8)["start"])
    assert not np.array_equal(first["start"], Windows(contents, 10).at(64, 4, 7)["start"])
    for row, start in enumerate(first["start"]):
        clip = contents.clips[first["clip"][row]]
        assert clip.split == "train"
        assert clip.offset <= start <= clip.offset + clip.frames - 10
        assert contents.speakers[first["speaker"][row]] == clip.speaker
        np.testing.assert_array_equal(first["audio"][row], contents.arrays["audio"][start : start + 10])


@pytest.mark.parametrize("balanced", [False, True])
def test_the_rows_of_processes_are_those_of_one(store, balanced):
    windows = Windows(Store(store), 10, balanced=balanced)
    whole = windows.at(12, 0, 5)
    parts = [windows.at(12, 0, 5, rank=rank, parts=3) for rank in range(3)]
    for name in whole:
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), whole[name])


def test_balanced_batches_have_as_many_of_each_speaker(store):
    windows = Windows(Store(store), 10, balanced=True)
    batches = [windows.at(12, 0, step)["speaker"] for step in range(200)]
    assert all((np.bincount(row) == 4).all() for row in batches)
    odd = [np.bincount(windows.at(7, 0, step)["speaker"], minlength=3) for step in range(50)]
    assert all(row.max() - row.min() == 1 for row in odd)
    starts = {int(start) for step in range(900) for start in windows.at(12, 0, step)["start"]}
    assert len(starts) == len(windows)  # every window can come
    plain = np.bincount(np.concatenate([Windows(Store(store), 10).at(12, 0, step)["speaker"] for step in range(100)]))
    assert plain[0] > 3 * plain[2]


@pytest.mark.parametrize(("share", "count"), [(0.1, 1), (0.5, 3), (0.7, 5), (0.8, 5)])
def test_as_many_clips_are_held_out_as_the_share_says(tmp_path, share, count):
    store = Store(make_store(tmp_path / "store", validation=False))
    assert len(Windows(store, 10).clips) == 6
    assert len(Windows(store, 10, split="validation", held_out=share).clips) == count


def test_held_out_clips_are_in_one_split_only(tmp_path):
    store = Store(make_store(tmp_path / "store", mirrored=True, validation=False))
    train_clips = {*Windows(store, 10, held_out=0.3).clips.tolist()}
    held_out_clips = {*Windows(store, 10, split="validation", held_out=0.3).clips.tolist()}
    assert held_out_clips
    assert train_clips
    assert not train_clips & held_out_clips
    assert len(train_clips | held_out_clips) == 7
    names = {store.clips[k].name for k in held_out_clips}
    assert ("ann-1" in names) == ("ann-1|mirror" in names)
    plain = {store.clips[k].name for k in Windows(store, 10, mirror=False).clips}
    assert plain == {f"{name}-{k}" for name in ("ann", "bob", "cleo") for k in (1, 2)}


def test_statistics_of_reduced_audio_are_those_of_the_training_split(store):
    contents = Store(store)
    statistics = standard_audio(contents, lambda columns: columns[:, :2] * 3 + 100)
    mean, std = contents.statistics("audio")
    np.testing.assert_allclose(statistics.mean, mean[:2] * 3 + 100, rtol=1e-5)
    np.testing.assert_allclose(statistics.std, std[:2] * 3, rtol=1e-4)
    assert standard_audio(contents, lambda columns: columns[:, :1] * 0 + 5).std == 1
    assert standard_pose(contents).std.min() >= POSE_FLOOR


def test_a_run_says_what_it_was_trained_on(store, tmp_path):
    run(plan(steps=1), store, tmp_path / "run")
    facts = read_facts(tmp_path / "run")
    assert facts["sizes"] == {"pose": POSE, "audio": 5, "speakers": 3, "words": 1}
    assert facts["store"]["speakers"] == ["ann", "bob", "cleo"]
    assert facts["config"] == {"hidden": 8, "frames": 10, "noise": 0.1, "break_at": -1}
    assert str(tmp_path) not in (tmp_path / "run" / "config.json").read_text()
    statistics, _ = read_tensors(tmp_path / "run" / "statistics.safetensors")
    assert {name: tuple(value.shape) for name, value in statistics.items()} == {
        "pose_mean": (6,), "pose_std": (6,), "audio_mean": (5,), "audio_std": (5,),
    }  # fmt: skip
    model, again = load_run(tmp_path / "run")
    assert again == facts
    assert not model.training
