"""The study: made, answered through HTTP by simulated raters, reported; exported and taken in again."""

from __future__ import annotations

import csv
import json
import sqlite3
import subprocess
import sys
from collections import Counter
from contextlib import contextmanager
from itertools import pairwise
from random import Random

import pytest

from cospeech.cli import progress
from cospeech.errors import InputError
from cospeech.studio.study import load_plan, make_study, report_study
from cospeech.studio.study.answers import Answers
from cospeech.studio.study.plan import save_plan
from cospeech.studio.study.session import Trial, answer_keys, describe_study, describe_trial, make_session
from cospeech.studio.study.static import export_page, import_answers
from cospeech.studio.study.tables import write_tables
from cospeech.studio.study.templates import TEMPLATES
from tests.support.study_raters import ask, encode_answers, make_tiny_study, rate, right_answers, serving, write_video

pytest.importorskip("starlette", reason="local pages need starlette (the studio extra)")
pytest.importorskip("uvicorn", reason="local pages need uvicorn (the studio extra)")
pytest.importorskip("scipy", reason="reports need scipy (the studio extra)")
av = pytest.importorskip("av", reason="videos need PyAV (the av extra)")

EFFECT = 1.2  # points of a scale by which a is better than b; c is as b


def rates(draw: Random, trial: Trial, question: str, place: int) -> int:
    better = EFFECT if trial.systems[place] == "a" else 0.0
    return min(5, max(1, round(draw.gauss(3 + better, 1))))


def prefers(draw: Random, trial: Trial, question: str, place: int) -> int:
    lean = [EFFECT if system == "a" else 0.0 for system in trial.systems]
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
        for number in range(16):
            hasty, pages = number == 5, 4 if number == 7 else None
            rate(port, plan, number, clicks if hasty else rates, careless=hasty, pages=pages)
    text, findings = report_study(study)
    assert [len(names) for names in findings.raters[:3]] == [14, 1, 1]
    assert {tuple(counts.values()) for counts in findings.answers.values()} == {(14 * 8,) * 3}
    assert findings.coverage == (14 * 3, 14 * 3)
    for question in plan.questions:
        assert findings.chances[question.name, "a", "b"] < 0.05
        assert findings.chances[question.name, "a", "c"] < 0.05
        assert findings.chances[question.name, "b", "c"] > 0.05
        assert findings.means[question.name]["a"].mean - findings.means[question.name]["b"].mean == pytest.approx(
            EFFECT, abs=0.4
        )
    assert "14 raters count; 1 failed attention checks; 1 did not finish" in text
    assert "a is higher" in text


@pytest.mark.slow
def test_forty_raters_of_three_systems_on_twenty_speeches(tmp_path):
    folder = make_tiny_study(tmp_path, 3, 20, template="preference")
    plan = load_plan(folder)
    with serving(folder) as port:
        for number in range(40):
            rate(port, plan, number, prefers)
    _, findings = report_study(folder)
    assert len(findings.raters.kept) == 40
    for question in plan.questions:
        assert findings.chances[question.name, "a", "b"] < 0.001
        assert findings.chances[question.name, "a", "c"] < 0.001
        assert findings.chances[question.name, "b", "c"] > 0.05


def test_a_session_is_counterbalanced():
    plan = tiny_plan("preference")
    sessions = [make_session(plan, number) for number in range(24)]
    pairs = Counter(trial.systems for trials in sessions for trial in trials if not trial.check)
    assert len(pairs) == 6  # each pair in both orders
    assert max(pairs.values()) == min(pairs.values())
    stimuli = Counter(trial.stimulus for trials in sessions for trial in trials if not trial.check)
    assert max(stimuli.values()) == min(stimuli.values())
    for trials in sessions:
        assert sum(trial.check is not None for trial in trials) == 2
        assert all(a.stimulus != b.stimulus for a, b in pairwise(trials) if not (a.check or b.check))
    assert make_session(plan, 5) == make_session(plan, 5)
    assert make_session(plan, 5) != make_session(plan, 6)


def tiny_plan(template, **changes):
    """A plan of three systems on six speeches, without files."""
    from cospeech.studio.study.plan import StudyClip, StudyPlan

    kind, systems = TEMPLATES[template], ["a", "b", "c"]
    systems += ["d"] if kind.mismatches else []
    clips = [
        StudyClip(id=f"{k:08x}{n:08x}", system=s, stimulus=f"s{n}", file=f"{k:08x}{n:08x}.mp4")
        for k, s in enumerate(systems)
        for n in range(6)
    ]
    others = {"b": "a", "c": "d"} if kind.mismatches else {}
    given = {
        "title": "words", "template": template, "consent": "words", "instructions": "words", "thanks": "words",
        "shows": kind.shows, "questions": list(kind.questions), "systems": systems, "stimuli_each": 3, "clips": clips,
        "reference": "a" if kind.needs_reference else None, "mismatched": others,
    }  # fmt: skip
    return StudyPlan.model_validate(given | changes)


@pytest.mark.parametrize("template", TEMPLATES)
def test_every_template_goes_from_plan_to_report(tmp_path, template):
    from cospeech.studio.study.report import count_raters, read_votes, report_text, study_findings

    plan = tiny_plan(template, transfer=["c"] if template == "mix-stage" else [])
    save_plan(plan, tmp_path)
    draw = Random(1)
    with Answers(tmp_path, plan) as answers:
        for _ in range(6):
            rater = answers.add_rater()
            for k, trial in enumerate(make_session(plan, rater.number)):
                keys = answer_keys(plan, trial)
                given = right_answers(plan, trial) if trial.check else {key: draw.choice(v) for key, v in keys.items()}
                answers.add(rater, k, given, 10)
        raters = count_raters(plan, answers)
        votes = read_votes(plan, answers, raters.kept)
    assert len(raters.kept) == 6
    findings = study_findings(plan, votes, raters)
    text = report_text(plan, findings)
    assert all(f"## {question.name}" in text for question in plan.questions)
    assert all(findings.means[question.name] for question in plan.questions)
    names = {path.name for path in write_tables(tmp_path, tmp_path / "tables")}
    assert {"answers.csv", "raters.csv"} <= names


def test_the_style_of_a_system_that_transfers_should_differ(tmp_path):
    from cospeech.studio.study.report import Vote, _scores

    plan = tiny_plan("mix-stage", transfer=["c"])
    question = plan.questions[1]
    votes = [Vote("r", "s0", "style", ("a", "b"), "", 1), Vote("r", "s0", "style", ("c", "a"), "", 1)]
    assert _scores(plan, question, votes) == {"b": [("r", "s0", 1.0)], "c": [("r", "s0", 0.0)]}


def test_the_page_is_told_no_name():
    plan = tiny_plan("mix-stage")
    text = json.dumps([describe_study(plan), [describe_trial(plan, trial) for trial in make_session(plan, 0)]])
    assert not any(f'"{word}"' in text for word in [*plan.systems, *plan.stimuli])


def fill(folder, plan, raters, choose, *, code="", pages=None, number=None):
    """Answer as so many raters do; attention checks are passed unless ``code`` is careless."""
    with Answers(folder, plan) as answers:
        for k in range(raters):
            rater = answers.add_rater(f"{code}{k}" if code else "")
            for page, trial in enumerate(make_session(plan, rater.number)[:pages]):
                given = {key: choose(trial, values) for key, values in answer_keys(plan, trial).items()}
                answers.add(rater, page, right_answers(plan, trial) if trial.check and code != "careless" else given, 3 + k)


def read_rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_tables_have_all_that_was_answered(tmp_path):
    plan = tiny_plan("preference", fewest_checks=2)
    save_plan(plan, tmp_path)
    fill(tmp_path, plan, 2, lambda trial, values: values[0], code="P_1 ü")  # the left video, clearly
    fill(tmp_path, plan, 1, lambda trial, values: 0, code="careless")
    fill(tmp_path, plan, 1, lambda trial, values: 0, pages=2)
    write_tables(tmp_path, tmp_path / "out")
    votes = read_rows(tmp_path / "out" / "motion_realism.csv")
    assert ",".join(votes[0]) == "user,input_code,model_a,model_b,winner,is_strong,juiceOptions,juiceOtherReason"
    assert len(votes) == 2 * 3 * 3  # raters, pairs, speeches
    assert {(row["winner"], row["is_strong"]) for row in votes} == {("model_a", "True")}
    raters = read_rows(tmp_path / "out" / "raters.csv")
    assert [row["outcome"] for row in raters] == ["counts", "counts", "failed checks", "stopped"]
    assert [row["participant"] for row in raters] == ["P_1 ü0", "P_1 ü1", "careless0", ""]
    assert [row["left_share"] for row in raters] == ["1.000", "1.000", "0.500", "0.500"]
    assert [(row["checks_passed"], row["checks_failed"]) for row in raters[:3]] == [("2", "0"), ("2", "0"), ("0", "2")]
    assert [row["seconds_of_fastest_page"] for row in raters] == ["3.00", "4.00", "3.00", "3.00"]
    rows = read_rows(tmp_path / "out" / "answers.csv")
    assert {row["outcome"] for row in rows} == {"counts", "failed checks", "stopped"}
    assert sum(bool(row["check"]) for row in rows) >= 3 * 2
    assert [row["page"] for row in rows[:11]] == [str(k) for k in range(1, 12)]
    assert "P_1" not in (tmp_path / "out" / "answers.csv").read_text("utf-8")
    text, findings = report_study(tmp_path)
    assert "The video on the left won 100 % of the comparisons (p = – against 50 %)" in text
    assert findings.coverage[0] > 0
    wins = findings.wins["motion_realism"]
    assert sum(map(sum, wins.values())) == len(votes)
    assert all(ties == 0 for _, ties, _ in wins.values())


def test_no_spreadsheet_takes_a_cell_for_a_formula(tmp_path):
    plan = tiny_plan("preference")
    new_names = {f"s{n}": f"=s{n}" for n in range(6)}
    clips = [clip.model_copy(update={"stimulus": new_names[clip.stimulus]}) for clip in plan.clips]
    plan = plan.model_copy(update={"clips": clips})
    save_plan(plan, tmp_path)
    fill(tmp_path, plan, 1, lambda trial, values: 0)
    write_tables(tmp_path, tmp_path / "out")
    rows = read_rows(tmp_path / "out" / "motion_realism.csv")
    assert {row["input_code"][:2] for row in rows} == {"'="}
    assert {row["winner"] for row in rows} == {"tie"}


@pytest.mark.parametrize(("systems", "stimuli"), [(2, 3), (2, 8), (3, 5), (4, 4), (5, 7)])
def test_side_does_not_go_with_speech_or_round(systems, stimuli):
    """Of each pair on each speech, and in each round, the sides are balanced over raters."""
    plan = plan_of(systems, stimuli)
    units = systems * (systems - 1) // 2
    cells, rounds, left = Counter(), Counter(), Counter()
    raters = 8 * units
    for number in range(raters):
        trials = [trial for trial in make_session(plan, number) if not trial.check]
        for k, trial in enumerate(trials):
            pair, side = tuple(sorted(trial.systems)), trial.systems[0] < trial.systems[1]
            cells[pair, trial.stimulus, side] += 1
            rounds[pair, k // stimuli, side] += 1
            left[side] += 1
    assert {cells[key[:2] + (not key[2],)] for key in cells} == {raters // 2} == {*cells.values()}
    assert {rounds[key[:2] + (not key[2],)] for key in rounds} == {*rounds.values()}
    assert left[True] == left[False]


def test_in_groups_each_clip_stands_beside_each_other_equally_often():
    for systems in (3, 4, 5):
        plan = plan_of(systems, 6, "stylised-flow")
        beside, first = Counter(), Counter()
        for number in range(2 * systems):
            for trial in make_session(plan, number):
                if not trial.check:
                    first[trial.systems[0]] += 1
                    beside.update(pairwise(trial.systems))
        assert len({*first.values()}) == 1
        assert len(beside) == systems * (systems - 1)
        assert len({*beside.values()}) == 1


def plan_of(systems, stimuli, template="preference"):
    """A plan without files, in which every rater sees all."""
    from cospeech.studio.study.plan import StudyClip

    names = [f"m{k}" for k in range(systems)]
    clips = [
        StudyClip(id=f"{k:08x}{n:08x}", system=s, stimulus=f"s{n}", file=f"{k:08x}{n:08x}.mp4")
        for k, s in enumerate(names)
        for n in range(stimuli)
    ]
    return tiny_plan(template, systems=names, clips=clips, stimuli_each=stimuli)


def test_checks_do_not_stand_beside_their_clips():
    for number in range(40):
        trials = make_session(plan_of(3, 8), number)
        for one, two in pairwise(trials):
            assert not (one.check or two.check) or one.stimulus != two.stimulus


def test_sessions_that_were_left_or_spoilt_are_given_out_again(tmp_path, monkeypatch):
    from cospeech.studio.study import answers as module

    plan = tiny_plan("preference")
    fill(tmp_path, plan, 1, lambda trial, values: 0, code="good")
    fill(tmp_path, plan, 1, lambda trial, values: 0, code="left", pages=3)
    fill(tmp_path, plan, 1, lambda trial, values: 0, code="careless")
    with Answers(tmp_path, plan) as answers:
        assert answers.add_rater().number == 2  # of the careless one
        assert answers.add_rater().number == 3  # the second may still come back
        monkeypatch.setattr(module, "GONE", -1.0)
        assert answers.add_rater().number == 1  # he did not
        assert answers.add_rater("left0").number == 1  # and now he does


def test_a_participant_is_taken_once(study, tmp_path):
    plan = load_plan(study)
    rows = [
        {"trial": k, "answers": encode_answers(plan, right_answers(plan, t)), "seconds": 4}
        for k, t in enumerate(make_session(plan, 0))
    ]
    files = []
    for k, code in enumerate(("one", "one", "", "")):
        files.append(tmp_path / f"{k}.json")
        content = {"study": plan.digest, "session": 0, "rater": f"{k:032x}", "participant": code, "answers": rows}
        files[-1].write_text(json.dumps(content))
    assert import_answers(study, files) == (3, 0, 1)
    assert import_answers(study, files) == (0, 3, 1)


def test_means_are_tested_against_chance_and_ratings_are_not(tmp_path):
    from cospeech.studio.study.report import findings_json

    plan = tiny_plan("mix-stage")
    save_plan(plan, tmp_path)
    draw = Random(3)
    fill(tmp_path, plan, 30, lambda trial, values: draw.choice(values))
    _, findings = report_study(tmp_path)
    for name in ("naturalness", "style"):
        for system, mean in findings.means[name].items():
            assert mean.p > 0.01, (name, system)
    ratings = tiny_plan("chain-of-generation")
    (tmp_path / "b").mkdir()
    save_plan(ratings, tmp_path / "b")
    fill(tmp_path / "b", ratings, 6, lambda trial, values: draw.choice(values))
    report = findings_json(report_study(tmp_path / "b")[1])
    assert {one["p"] for means in report["means"].values() for one in means.values()} == {None}


def test_a_rater_goes_on_after_a_pause(study):
    with serving(study) as port:
        first = json.loads(ask(port, "/api/raters", {"consent": True, "participant": "abc123"})[2])
        answers = encode_answers(plan := load_plan(study), right_answers(plan, make_session(plan, 0)[0]))
        status, _, content = ask(port, "/api/answers", {"trial": 0, "answers": answers, "seconds": 3}, x_rater=first["rater"])
        assert status == 200
        assert json.loads(content) == {"done": 1, "of": len(first["trials"]), "completion": ""}
    with serving(study) as port:  # the server was ended meanwhile
        again = json.loads(ask(port, "/api/session", x_rater=first["rater"])[2])
        assert again == first | {"done": [0]}
        assert json.loads(ask(port, "/api/raters", {"consent": True, "participant": "abc123"})[2]) == again
        other = json.loads(ask(port, "/api/raters", {"consent": True})[2])
        assert other["rater"] != first["rater"]
        assert other["trials"] != first["trials"]


def test_a_link_among_the_clips_shows_no_other_file(study, tmp_path):
    clip = study / "clips" / load_plan(study).clips[0].file
    (tmp_path / "secret.txt").write_text("a secret")
    clip.unlink()
    clip.symlink_to(tmp_path / "secret.txt")
    with serving(study) as port:
        assert ask(port, f"/clips/{clip.name}")[0] == 404
    with pytest.raises(InputError, match=r"the clip '.*\.mp4' is a link"):
        export_page(study, tmp_path / "page")
    assert not (tmp_path / "page").exists()


def test_an_exported_page_and_its_answers(study, tmp_path):
    plan = export_page(study, tmp_path / "page", sessions=3)
    files = {path.name for path in (tmp_path / "page").iterdir()}
    assert files == {"index.html", "study.js", "study.css", "study.json", "clips"}
    assert 'data-mode="static"' in (tmp_path / "page" / "index.html").read_text()
    content = json.loads((tmp_path / "page" / "study.json").read_text())
    assert len(content["sessions"]) == 3
    trials = make_session(plan, 2)
    rows = [{"trial": k, "answers": encode_answers(plan, right_answers(plan, t)), "seconds": 4} for k, t in enumerate(trials)]
    result = {"study": content["study"]["study"], "session": 2, "rater": "0f" * 16, "participant": "", "answers": rows}
    good, bad = tmp_path / "good.json", tmp_path / "bad.json"
    good.write_text(json.dumps(result))
    wrong = [
        result | {"study": "another"}, result | {"session": -1}, result | {"session": True}, result | {"rater": "../x"}, [],
        result | {"answers": [{"trial": 999, "answers": {}, "seconds": 1}]}, result | {"participant": "x" * 65},
        result | {"answers": [rows[0] | {"answers": {"naturalness": [9]}}]}, result | {"answers": [7]},
    ]  # fmt: skip
    for given in wrong:
        bad.write_text(json.dumps(given))
        with pytest.raises(InputError, match=r"bad\.json"):
            import_answers(study, [good, bad])
    assert import_answers(study, [good]) == (1, 0, 0)
    assert import_answers(study, [good]) == (0, 1, 0)
    assert len(report_study(study)[1].raters.kept) == 1


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
    (tmp_path / "a" / "._x.mp4").write_bytes(b"what macOS leaves beside a file on a foreign disc")
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
    save_plan(plan := plan.model_copy(update={"seed": 7}), study)
    with Answers(study, load_plan(study)) as answers:  # nobody has come: it may change
        answers.add_rater()
    save_plan(plan.model_copy(update={"consent": "other words", "completion": "https://example.org/done"}), study)
    Answers(study, load_plan(study)).close()
    save_plan(plan.model_copy(update={"seed": 99}), study)
    with pytest.raises(InputError, match="changed after the first rater"):
        Answers(study, load_plan(study))
    (study / "plan.json").write_text('{"version": 2}')
    with pytest.raises(InputError, match=r"plan\.json.*title"):
        load_plan(study)
    (study / "plan.json").write_text('{"version": 1}')
    with pytest.raises(InputError, match="of another version of cospeech: 1"):
        load_plan(study)
    (study / "answers.sqlite").write_bytes(b"no data base" * 1000)
    with pytest.raises(InputError, match="it is damaged"):
        Answers(study, plan)


@pytest.mark.parametrize("problem", ["damaged", "changed"])
def test_after_an_error_the_database_is_closed_and_can_be_moved_away(study, monkeypatch, problem):
    opener, connections, plan = sqlite3.connect, [], load_plan(study)
    monkeypatch.setattr(sqlite3, "connect", lambda *a, **options: connections.append(opener(*a, **options)) or connections[-1])
    if problem == "damaged":
        (study / "answers.sqlite").write_bytes(b"no data base" * 1000)
    else:
        with Answers(study, plan) as answers:
            answers.add_rater()
        plan = plan.model_copy(update={"seed": 99})
    with pytest.raises(InputError):
        Answers(study, plan)
    with pytest.raises(sqlite3.ProgrammingError, match="closed"):
        connections[-1].execute("SELECT 1")


@pytest.mark.slow
def test_the_commands(tmp_path):
    def run(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "cospeech", "study", *arguments], cwd=tmp_path, capture_output=True, text=True
        )

    make_tiny_study(tmp_path, 2, 2)
    result = run("make", "a", "b", "-o", "s2", "--variant", "mute", "--seed", "4")
    assert (result.returncode, result.stderr) == (0, ""), result
    assert "2 systems, 2 speeches, 4 pages a rater" in result.stdout
    assert run("export", "s2", "page").returncode == 0
    assert "There is nothing to report yet." in run("report", "s2").stdout


def test_on_a_terminal_the_bar_is_told_of_each_clip(tmp_path, cli, monkeypatch):
    make_tiny_study(tmp_path, 2, 2)
    amounts = []

    @contextmanager
    def show_progress(title, quiet):
        with progress.show_progress(title, quiet) as tell:
            yield lambda *amount: (tell(*amount), amounts.append(amount))

    monkeypatch.setattr("cospeech.cli.study.show_progress", show_progress)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.chdir(tmp_path)
    code, _, err = cli("study", "make", "a", "b", "-o", "s2")
    assert (code, err) == (0, "")
    assert amounts == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_the_way_back_is_told_at_the_end_alone(tmp_path):
    folder = make_tiny_study(tmp_path, 2, 1, completion="https://example.org/done", checks=0)
    plan = load_plan(folder)
    with serving(folder) as port:
        assert b"example.org" not in ask(port, "/api/study")[2]
        session = json.loads(ask(port, "/api/raters", {"consent": True})[2])
        assert session["completion"] == ""
        answers = encode_answers(plan, {key: values[0] for key, values in answer_keys(plan, make_session(plan, 0)[0]).items()})
        answer = {"trial": 0, "answers": answers, "seconds": 3}
        assert json.loads(ask(port, "/api/answers", answer, x_rater=session["rater"])[2])["completion"] == plan.completion
        assert json.loads(ask(port, "/api/session", x_rater=session["rater"])[2])["completion"] == plan.completion


def test_answers_are_kept_as_a_whole_or_not_at_all(tmp_path):
    plan = tiny_plan("preference")
    with Answers(tmp_path, plan) as answers:
        rater = answers.add_rater()
        key, trial = ("motion_realism", -1), make_session(plan, 0)[0]
        assert key in answer_keys(plan, trial)
        with pytest.raises(Exception, match="NOT NULL"):
            answers.add(rater, 0, {key: None}, 3.0)
        answers.add(rater, 0, {key: 1}, 3.0)
        other = rater._replace(rater="0f" * 16)
        with pytest.raises(Exception, match="NOT NULL"):
            answers.add_session(other, {0: ({key: None}, 3.0)})
        assert answers.add_session(other, {0: ({key: 1}, 3.0)}) == "added"


def test_a_few_equal_answers_prove_nothing():
    import numpy as np

    from cospeech.studio.study.statistics import estimate

    assert np.isnan(estimate(np.ones((2, 2))).p)
    assert estimate(np.zeros((2, 2))).p == 1
