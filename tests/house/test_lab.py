"""The tutorial docs/tutorials/lab.md: its commands and files, as a class types and saves them, on a smaller corpus."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile
from PIL import Image

from cospeech.cli.demo import EXAMPLE
from tests.house.test_docs import ROOT, commands, fences, run
from tests.house.test_docs_add import files
from tests.support.command_line import change_options, type_command

pytestmark = pytest.mark.slow

PAGE = ROOT / "docs" / "tutorials" / "lab.md"
STYLES = ("natural", "lively", "calm")


def run_script(name: str, place: Path) -> str:
    """What a script of the page prints."""
    process = subprocess.run(
        [sys.executable, name], cwd=place, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONIOENCODING": "utf-8"},
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    return process.stdout


def measure(path: Path) -> tuple[int, int]:
    """Width and height of a picture, pixels."""
    with Image.open(path) as picture:
        return picture.size


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A folder in which a student has saved all files of the page, and made three styles of six seconds."""
    place = tmp_path_factory.mktemp("lab")
    soundfile.write(place / "talk.wav", *soundfile.read(EXAMPLE, frames=96_000))
    for name, text in files("tutorials/lab.md").items():
        (place / name).write_text(text, "utf-8", newline="\n")
    for line in commands(PAGE):
        run(line, place)
    return place


def test_the_strips_become_one_picture(desk):
    run_script("compare.py", desk)
    strips = [measure(desk / f"{style}.png") for style in STYLES]
    assert measure(desk / "compare.png") == (max(w for w, _ in strips), sum(h for _, h in strips))


def test_the_speed_of_the_wrists_tells_the_styles_apart(desk):
    output = run_script("wrists.py", desk)
    speeds = dict(re.findall(r"^(\w+): mean speed ([\d.]+) m/s", output, re.M))
    assert tuple(speeds) == STYLES
    assert float(speeds["lively"]) > float(speeds["calm"])
    rows = np.loadtxt(desk / "lively.speed.csv", delimiter=",", skiprows=1)
    assert rows.shape == (179, 4)
    (plot,) = fences(PAGE, "py")
    compile(plot, "plot.py", "exec")  # matplotlib is no dependency of ours


def test_the_table_has_the_metric_and_the_model(desk):
    for name in ("h5py", "scipy"):
        pytest.importorskip(name, reason=f"corpora need {name} (cospeech[corpora])")
    (desk / "voices").mkdir()
    shutil.copy(EXAMPLE, desk / "voices")
    lines = [line.partition("#")[0].strip() for line in fences(PAGE, "bash")[0].splitlines()]
    assert [line.split()[1] for line in lines] == ["synthesise", "prepare"]
    for line in lines:
        type_command(change_options(line, "--hours 0.01 --no-act") if "synthesise" in line else line, desk)
    output = run_script("table.py", desk)
    rows = {line[:17].strip(): line.split() for line in output.splitlines()}
    for row in ("rules", "mine", "ground truth", "frozen pose", "white noise", "shuffled speech", "another clip"):
        assert row in rows, output
    assert re.search(r"^[!~] loud_hands: ", output, re.M), "the page says that the metric cannot rank systems"
    run_script("look.py", desk)
    assert measure(desk / "mine.png")[1] == measure(desk / "calm.png")[1]
