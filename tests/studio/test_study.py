"""The study: made, answered through HTTP by simulated raters, reported; exported and taken in again."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from collections import Counter
from itertools import pairwise
from random import Random

import pytest

from cospeech.errors import InputError
from cospeech.studio.study import load_plan, make_study, report_study
from cospeech.studio.study.answers import Answers
from cospeech.studio.study.plan import save_plan
from cospeech.studio.study.session import Trial, answer_keys, describe_study, describe_trial, make_session
from cospeech.studio.study.static import export_page, import_answers
from cospeech.studio.study.tables import write_tables
from cospeech.studio.study.templates import TEMPLATES
from tests.support.study_raters import as_sent, ask, make_tiny_study, rate, right_answers, serving, write_video

pytest.importorskip("starlette", reason="local pages need starlette (the studio extra)")
pytest.importorskip("uvicorn", reason="local pages need uvicorn (the studio extra)")
pytest.importorskip("scipy", reason="reports need scipy (the studio extra)")
av = pytest.importorskip("av", reason="videos need PyAV (the av extra)")

PLANTED = 1.2  # points of a scale by which a is better than b; c is as b


def rates(draw: Random, trial: Trial, question: str, place: int) -> int:
    better = PLANTED if trial.systems[place] == "a" else 0.0
    return min(5, max(1, round(draw.gauss(3 + better, 1))))


def prefers(draw: Random, trial: Trial, question: str, place: int) -> int:
    lean = [PLANTED if system == "a" else 0.0 for system in trial.systems]
    return min(2, max(-2, round(draw.gauss(lean[-1] - lean[0], 1))))


def clicks(draw: Random, trial: Trial, question: str, place: int) -> int:
    return draw.randint(1, 5)


@pytest.fixture
def study(tmp_path):
    return make_tiny_study(tmp_path, 3, 8, template="chain-of-generation", seed=3)


@pytest.mark.slow
def test_raters_find_the_planted_effect_and_no_other(study):
    plan = load_plan(study)
    with serving(study) as port:
        for number in range(12):
            hasty, pages = number == 5, 4 if number == 7 else None
            rate(port, plan, number, clicks if hasty else rates, careless=hasty, pages=pages)
    text, findings, votes = report_study(study)
    assert [len(names) for names in findings.counted[:3]] == [10, 1, 1]
    assert len(votes) == 10 * 3 * 8 * 4
    for question in plan.questions:
        assert findings.chances[question.name, "a", "b"] < 0.05
        assert findings.chances[question.name, "a", "c"] < 0.05
        assert findings.chances[question.name, "b", "c"] > 0.05
        assert findings.means[question.name]["a"].mean - findings.means[question.name]["b"].mean == pytest.approx(
            PLANTED, abs=0.4
        )
    assert "10 raters count; 1 failed attention checks; 1 did not finish" in text
    assert "a is higher" in text


@pytest.mark.slow
def test_forty_raters_of_three_systems_on_twenty_speeches(tmp_path):
    folder = make_tiny_study(tmp_path, 3, 20, template="preference")
    plan = load_plan(folder)
    with serving(folder) as port:
        for number in range(40):
            rate(port, plan, number, prefers)
    _, findings, _ = report_study(folder)
    assert len(findings.counted.kept) == 40
    for question in plan.questions:
        assert findings.chances[question.name, "a", "b"] < 0.001
        assert findings.chances[question.name, "a", "c"] < 0.001
        assert findings.chances[question.name, "b", "c"] > 0.05


def test_a_session_is_counterbalanced():
    plan = tiny_plan("preference")
    sessions = [make_session(plan, number) for number in range(24)]
    shown = Counter(trial.systems for trials in sessions for trial in trials if not trial.check)
    assert len(shown) == 6  # each pair in both orders
    assert max(shown.values()) == min(shown.values())
    seen = Counter(trial.stimulus for trials in sessions for trial in trials if not trial.check)
    assert max(seen.values()) == min(seen.values())
    for trials in sessions:
        assert sum(trial.check is not None for trial in trials) == 2
        assert all(a.stimulus != b.stimulus for a, b in pairwise(trials) if not (a.check or b.check))
    assert make_session(plan, 5) == make_session(plan, 5)
    assert make_session(plan, 5) != make_session(plan, 6)


def tiny_plan(template, **changes):
    """A plan of three systems on six speeches, without files."""
    from cospeech.studio.study.plan import StudyClip, StudyPlan

    kind, systems = TEMPLATES[template], ["a", "b", "c"]
    clips = [
        StudyClip(id=f"{k:08x}{n:08x}", system=s, stimulus=f"s{n}", file=f"{k:08x}{n:08x}.mp4")
        for k, s in enumerate(systems)
        for n in range(6)
    ]
    given = {
        "title": "words", "template": template, "consent": "words", "instructions": "words", "thanks": "words",
        "shows": kind.shows, "questions": list(kind.questions), "systems": systems, "stimuli_each": 3, "clips": clips,
        "reference": "a" if kind.needs_reference else None,
    }  # fmt: skip
    return StudyPlan.model_validate(given | changes)


@pytest.mark.parametrize("template", TEMPLATES)
def test_every_template_goes_from_plan_to_report(tmp_path, template):
    from cospeech.studio.study.report import count_raters, read_votes, report_text, study_findings

    plan = tiny_plan(template, transfer=["c"] if template == "mix-stage" else [])
    draw = Random(1)
    with Answers(tmp_path, plan) as answers:
        for _ in range(6):
            rater = answers.add_rater()
            for k, trial in enumerate(make_session(plan, rater.number)):
                keys = answer_keys(plan, trial)
                given = right_answers(plan, trial) if trial.check else {key: draw.choice(v) for key, v in keys.items()}
                answers.add(rater, k, given, 10)
        counted = count_raters(plan, answers)
        votes = read_votes(plan, answers, counted.kept)
    assert len(counted.kept) == 6
    findings = study_findings(plan, votes, counted)
    text = report_text(plan, findings)
    assert all(f"## {question.name}" in text for question in plan.questions)
    assert all(findings.means[question.name] for question in plan.questions)
    names = {path.name for path in write_tables(plan, votes, tmp_path / "tables")}
    assert "answers.csv" in names


def test_the_style_of_a_system_that_transfers_should_differ(tmp_path):
    from cospeech.studio.study.report import Vote, _scores

    plan = tiny_plan("mix-stage", transfer=["c"])
    question = plan.questions[1]
    votes = [Vote("r", "s0", "style", ("a", "b"), "", 1), Vote("r", "s0", "style", ("c", "a"), "", 1)]
    assert _scores(plan, question, votes) == {"b": [("r", "s0", 1.0)], "c": [("r", "s0", 0.0)]}


def test_the_page_is_told_no_name():
    plan = tiny_plan("mix-stage")
    told = json.dumps([describe_study(plan), [describe_trial(plan, trial) for trial in make_session(plan, 0)]])
    assert not any(f'"{word}"' in told for word in [*plan.systems, *plan.stimuli])


def test_votes_are_in_the_layout_of_genea(tmp_path):
    from cospeech.studio.study.report import Vote

    plan = tiny_plan("preference")
    votes = [
        Vote("R_1", "=s0", "motion_realism", ("b", "a"), "", -2),
        Vote("R_1", "s1", "motion_realism", ("a", "c"), "", 0),
        Vote("R_2", "s1", "motion_realism", ("a", "c"), "", 1),
    ]
    write_tables(plan, votes, tmp_path)
    with (tmp_path / "motion_realism.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert ",".join(rows[0]) == "user,input_code,model_a,model_b,winner,is_strong,juiceOptions,juiceOtherReason"
    assert [(row["model_a"], row["winner"], row["is_strong"]) for row in rows] == [
        ("b", "model_a", "True"), ("a", "tie", "False"), ("a", "model_b", "False"),
    ]  # fmt: skip
    assert rows[0]["input_code"] == "'=s0"  # no spreadsheet takes it for a formula


def test_a_rater_goes_on_after_a_pause(study):
    with serving(study) as port:
        first = json.loads(ask(port, "/api/raters", {"consent": True, "participant": "abc123"})[2])
        answers = as_sent(plan := load_plan(study), right_answers(plan, make_session(plan, 0)[0]))
        status, _, content = ask(port, "/api/answers", {"trial": 0, "answers": answers, "seconds": 3}, x_rater=first["rater"])
        assert status == 200
        assert json.loads(content) == {"done": 1, "of": len(first["trials"])}
    with serving(study) as port:  # the server was ended meanwhile
        again = json.loads(ask(port, "/api/session", x_rater=first["rater"])[2])
        assert again == first | {"done": [0]}
        assert json.loads(ask(port, "/api/raters", {"consent": True, "participant": "abc123"})[2]) == again
        other = json.loads(ask(port, "/api/raters", {"consent": True})[2])
        assert other["rater"] != first["rater"]
        assert other["trials"] != first["trials"]


def test_an_exported_page_and_its_answers(study, tmp_path):
    plan = export_page(study, tmp_path / "page", sessions=3)
    files = {path.name for path in (tmp_path / "page").iterdir()}
    assert files == {"index.html", "study.js", "study.css", "study.json", "clips"}
    assert 'data-mode="static"' in (tmp_path / "page" / "index.html").read_text()
    held = json.loads((tmp_path / "page" / "study.json").read_text())
    assert len(held["sessions"]) == 3
    trials = make_session(plan, 2)
    rows = [{"trial": k, "answers": as_sent(plan, right_answers(plan, t)), "seconds": 4} for k, t in enumerate(trials)]
    sent = {"study": held["study"]["study"], "session": 2, "rater": "0f" * 16, "participant": "", "answers": rows}
    good, bad = tmp_path / "good.json", tmp_path / "bad.json"
    good.write_text(json.dumps(sent))
    wrong = [
        sent | {"study": "another"}, sent | {"session": -1}, sent | {"session": True}, sent | {"rater": "../x"}, [],
        sent | {"answers": [{"trial": 999, "answers": {}, "seconds": 1}]}, sent | {"participant": "x" * 65},
        sent | {"answers": [rows[0] | {"answers": {"naturalness": [9]}}]}, sent | {"answers": [7]},
    ]  # fmt: skip
    for given in wrong:
        bad.write_text(json.dumps(given))
        with pytest.raises(InputError, match=r"bad\.json"):
            import_answers(study, [good, bad])
    assert import_answers(study, [good]) == (1, 0)
    assert import_answers(study, [good]) == (0, 1)
    assert len(report_study(study)[1].counted.kept) == 1


def test_clips_have_no_title_and_no_sound_where_none_is_wanted(tmp_path):
    folder = make_tiny_study(tmp_path, 2, 1, variant="mute")
    for path in (folder / "clips").iterdir():
        with av.open(str(path)) as video:
            assert not video.streams.audio
            assert "title" not in video.metadata
        assert b"secret" not in path.read_bytes()


@pytest.mark.slow
def test_motion_files_are_rendered(tmp_path):
    import soundfile

    import cospeech

    (tmp_path / "a").mkdir()
    soundfile.write(tmp_path / "a" / "x.wav", [0.0] * 8000, 16_000)
    speech = cospeech.Speech.load(tmp_path / "a" / "x.wav")
    cospeech.load("rules").generate(speech, seed=0).save(tmp_path / "a" / "x.bvh")
    plan = make_study([tmp_path / "a"], tmp_path / "hands", variant="hands", template="chain-of-generation")
    with av.open(str(tmp_path / "hands" / "clips" / plan.clips[0].file)) as video:
        assert video.streams.video[0].frames > 5
        assert video.streams.audio


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"template": "mix-stag"}, "did you mean 'mix-stage'"),
        ({"template": "mix-stage"}, "--reference"),
        ({"reference": "z"}, "no folder is named 'z'"),
        ({"variant": "hands"}, "give motion files"),
        ({"checks": 99}, "this makes no study"),
        ({"stimuli_each": 0}, "this makes no study"),
    ],
)
def test_what_makes_no_study_is_said(tmp_path, options, words):
    with pytest.raises(InputError, match=words):
        make_tiny_study(tmp_path, 2, 1, **options)
    assert not (tmp_path / "study").exists()


def test_folders_must_match(tmp_path):
    for name, clip in (("a", "x"), ("b", "y")):
        (tmp_path / name).mkdir()
        write_video(tmp_path / name / f"{clip}.mp4")
    with pytest.raises(InputError, match="different clips: 'x'"):
        make_study([tmp_path / "a", tmp_path / "b"], tmp_path / "study")
    (tmp_path / "b" / "y.mp4").write_bytes(b"no video")
    (tmp_path / "b" / "y.mp4").rename(tmp_path / "b" / "x.mp4")
    with pytest.raises(InputError, match="cannot copy the video"):
        make_study([tmp_path / "a", tmp_path / "b"], tmp_path / "study")
    assert {path.name for path in tmp_path.iterdir()} == {"a", "b"}


def test_a_plan_that_changed_after_the_first_rater_is_refused(study):
    plan = load_plan(study)
    Answers(study, plan).close()
    save_plan(plan.model_copy(update={"consent": "other words"}), study)
    Answers(study, load_plan(study)).close()
    save_plan(plan.model_copy(update={"seed": 99}), study)
    with pytest.raises(InputError, match="changed after the first rater"):
        Answers(study, load_plan(study))
    (study / "plan.json").write_text('{"version": 1}')
    with pytest.raises(InputError, match=r"plan\.json.*title"):
        load_plan(study)


@pytest.mark.slow
def test_the_commands(tmp_path):
    def run(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "cospeech", "study", *arguments], cwd=tmp_path, capture_output=True, text=True
        )

    make_tiny_study(tmp_path, 2, 2)
    made = run("make", "a", "b", "-o", "s2", "--variant", "mute", "--seed", "4")
    assert (made.returncode, made.stderr) == (0, ""), made
    assert "2 systems, 2 speeches, 4 pages a rater" in made.stdout
    assert run("export", "s2", "page").returncode == 0
    assert "0 raters count" in run("report", "s2").stdout
