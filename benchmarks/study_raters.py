"""Does a study find what is there? Simulated raters answer it through its real page: python benchmarks/study_raters.py

A study of three systems on 20 speeches is made with one command, served, and answered in headless Chromium: each rater agrees,
watches every video, clicks and goes on, as a person does. System a is better by --planted points of the scale; b and c are
alike. Then `cospeech study report` must find a better than both, and no difference between b and c. Else the exit code is 1.

Videos are eight grey pictures: a simulated rater looks at the system's name in the plan, which the page never shows. Needs
Chromium (COSPEECH_CHROMIUM, or one that `make test` unpacked), playwright, and the extras studio and av.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from random import Random

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from cospeech.studio.study.plan import StudyPlan, load_plan  # noqa: E402
from cospeech.studio.study.report import report_study  # noqa: E402
from cospeech.studio.study.session import Trial, answer_keys, make_session  # noqa: E402
from tests.support.browser import open_chromium  # noqa: E402
from tests.support.study_page import take_part, write_webm  # noqa: E402
from tests.support.study_raters import right_answers, serving  # noqa: E402

SYSTEMS = "abc"
LEAST, MOST = 0.001, 0.05  # of p, with Holm's correction: a difference that is found, and one that is not


def opinions(plan: StudyPlan, trial: Trial, draw: Random, effect: float) -> dict[tuple[str, int], int]:
    """Preferences of a person to whom system a seems better."""
    if trial.check:
        return right_answers(plan, trial)
    lean = [effect if system == "a" else 0.0 for system in trial.systems]
    return {key: min(2, max(-2, round(draw.gauss(lean[-1] - lean[0], 1)))) for key in answer_keys(plan, trial)}


def make_study(folder: Path, stimuli: int) -> Path:
    """Folders of videos, and ``cospeech study make``."""
    video = write_webm(folder / "video.webm")
    for system in SYSTEMS:
        (folder / system).mkdir()
        for k in range(stimuli):
            shutil.copyfile(video, folder / system / f"speech_{k:02d}.webm")
    command = [sys.executable, "-m", "cospeech", "study", "make", *SYSTEMS, "-o", "study", "--template", "preference"]
    subprocess.run(command, cwd=folder, check=True)
    return folder / "study"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--raters", type=int, default=40)
    parser.add_argument("--stimuli", type=int, default=20)
    parser.add_argument("--planted", type=float, default=1.2)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place, open_chromium() as browser:
        study = make_study(Path(place), options.stimuli)
        plan, began = load_plan(study), time.monotonic()
        with serving(study) as port:
            for number in range(options.raters):
                trials, draw = make_session(plan, number), Random(number)
                context = browser.new_context()
                page = context.new_page()
                page.goto(f"http://127.0.0.1:{port}/")
                take_part(page, trials, [opinions(plan, trial, draw, options.planted) for trial in trials])
                context.close()
                print(f"\rrater {number + 1} of {options.raters}", end="", file=sys.stderr, flush=True)
        text, findings = report_study(study)
        minutes = (time.monotonic() - began) / 60
    print(f"\n{text}\n\n{len(findings.raters.kept)} raters, {minutes:.1f} min in the page")
    is_found = all(findings.chances[question.name, "a", other] < LEAST for question in plan.questions for other in "bc")
    alike = all(findings.chances[question.name, "b", "c"] > MOST for question in plan.questions)
    print(f"the planted effect is {'found' if is_found else 'NOT found'}; b and c are {'alike' if alike else 'NOT alike'}")
    return 0 if is_found and alike else 1


if __name__ == "__main__":
    raise SystemExit(main())
