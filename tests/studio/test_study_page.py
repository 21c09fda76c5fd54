"""The page of a study in headless Chromium: a rater who watches and clicks, and nobody who is shut out."""

from __future__ import annotations

import pytest

from cospeech.studio.study.answers import Answers
from cospeech.studio.study.make import make_study
from cospeech.studio.study.plan import load_plan
from cospeech.studio.study.session import make_session
from cospeech.studio.study.static import export_page
from tests.support.browser import find_violations, open_chromium, wait_until
from tests.support.study_page import WATCH, answer, open_trial, take_part, write_webm
from tests.support.study_raters import encode_answers, right_answers, serving

pytest.importorskip("starlette", reason="local pages need starlette (the studio extra)")
pytest.importorskip("uvicorn", reason="local pages need uvicorn (the studio extra)")
pytest.importorskip("av", reason="videos need PyAV (the av extra)")

pytestmark = pytest.mark.slow


def write_videos(folder, *, speeches):
    for system in "ab":
        (folder / system).mkdir()
        for k in range(speeches):
            write_webm(folder / system / f"speech_{k}.webm")


@pytest.fixture
def study(tmp_path):
    write_videos(tmp_path, speeches=2)
    make_study([tmp_path / "a", tmp_path / "b"], tmp_path / "study", template="preference", stimuli_each=2, checks=1, seed=1)
    return tmp_path / "study"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_rater_takes_part_in_the_page(study, scheme):
    plan = load_plan(study)
    trials = make_session(plan, 0)
    with serving(study) as port, open_chromium() as browser:
        page = browser.new_context(color_scheme=scheme).new_page()
        wrong: list[str] = []
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto(f"http://127.0.0.1:{port}/")
        wait_until(page, "document.querySelector('h1')?.textContent === 'Before you start'")
        assert find_violations(page) == []
        page.click("button")
        wait_until(page, "document.getElementById('status').textContent.startsWith('Tick the box')")
        page.check("#agree")
        page.keyboard.press("Enter")
        for number, trial in enumerate(trials):
            open_trial(page, number, len(trials))
            if number == 0:
                assert find_violations(page) == []
                page.click("button[type=submit]", force=True)  # it is called disabled, and says why
                assert "watch every video" in page.inner_text("#status")
            page.evaluate(WATCH)
            if number == 0:
                page.click("button[type=submit]")
                assert "answer every question" in page.inner_text("#status")
            answer(page, right_answers(plan, trial))
        wait_until(page, "document.querySelector('h1').textContent === 'Thank you'")
        assert find_violations(page) == []
        assert not wrong
    with Answers(study, plan) as answers:
        (session,) = answers.sessions()
    assert session.trials == list(trials)
    assert [encode_answers(plan, session.answers[k]) for k in range(len(trials))] == [
        encode_answers(plan, right_answers(plan, t)) for t in trials
    ]
    assert all(value > 0 for value in session.seconds.values())


def take_session(page, plan, number):
    """Take part in session ``number``."""
    trials = make_session(plan, number)
    take_part(page, trials, [right_answers(plan, trial) for trial in trials])


def test_the_next_participant_at_a_computer_begins_anew(tmp_path):
    study = tmp_path / "study"
    write_videos(tmp_path, speeches=1)
    plan = make_study([tmp_path / "a", tmp_path / "b"], study, checks=0, seed=1, completion="https://example.org/done?code=1")
    with serving(study) as port, open_chromium() as browser:
        page = browser.new_page()
        for number, code in enumerate(("P_1_1", "P_11")):
            page.goto(f"http://127.0.0.1:{port}/?PROLIFIC_PID={code}")
            take_session(page, plan, number)
            assert page.get_attribute("#completion", "href") == plan.completion
            assert page.query_selector("#next-person") is None
        page.goto(f"http://127.0.0.1:{port}/?PROLIFIC_PID=P_1_1")  # he comes back
        wait_until(page, "document.querySelector('h1')?.textContent === 'Thank you'")
        page.goto(f"http://127.0.0.1:{port}/")
        take_session(page, plan, 2)
        assert find_violations(page) == []
        page.click("#next-person")
        wait_until(page, "document.querySelector('h1')?.textContent === 'Before you start'")
    with Answers(study, plan) as answers:
        assert [session.rater.participant for session in answers.sessions()] == ["P_1_1", "P_11", ""]


def test_an_exported_page_that_is_opened_as_a_file_says_what_to_do(study, tmp_path):
    export_page(study, tmp_path / "page", sessions=2)
    with open_chromium() as browser:
        page = browser.new_page()
        page.goto((tmp_path / "page" / "index.html").as_uri())
        wait_until(page, "document.querySelector('main').textContent.includes('python -m http.server')")
