"""The studio by keys, by touch and for screen readers; and after the studio was away for a while."""

# ruff: noqa: F811  fixtures
from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.studio.test_page import READY, address, chromium, draws, page, talking, wav  # noqa: F401  fixtures
from tests.studio.test_page_edits import COUNT, PLAN, free_gesture
from tests.support.browser import scrub, wait_until

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[2]
NOTICE = "document.getElementById('notice').textContent"


def test_a_take_that_failed_is_not_downloaded_and_is_made_when_the_studio_answers(talking):
    before = talking.evaluate("cospeechStudio.takes[0].id")
    talking.route("**/api/takes", lambda route: route.abort() if route.request.method == "POST" else route.continue_())
    talking.select_option("#emotion", "anger")
    wait_until(talking, "cospeechStudio.takes[0].problem")
    assert talking.get_attribute("#download", "aria-disabled") == "true"
    talking.unroute("**/api/takes")
    talking.select_option("#emotion", "sadness")
    talking.select_option("#emotion", "anger")
    wait_until(talking, f"{READY} && cospeechStudio.takes[0].id !== '{before}'")
    assert talking.evaluate("cospeechStudio.takes[0].problem") == ""
    assert talking.get_attribute("#download", "aria-disabled") == "false"


def test_a_gesture_goes_with_its_stroke_when_that_is_changed(talking):
    gesture = free_gesture(talking)
    button = talking.locator(f'[data-id="{gesture["id"]}"]')
    button.focus()
    talking.keyboard.press("Enter")
    talking.click("#change-gesture")
    later = round(gesture["stroke"] + 0.3, 2)
    talking.fill("#add-time", str(later))
    talking.click("#add-done")
    expression = f"{PLAN}.gestures.find(each => each.id === '{gesture['id']}')"
    wait_until(talking, f"Math.abs({expression}.stroke - {later}) < 0.02 && {READY}")
    assert talking.evaluate(f"{expression}.start < {expression}.stroke && {expression}.stroke < {expression}.end")
    assert talking.inner_text("#problem") == ""


def test_what_happens_is_told_and_the_clock_is_not(talking):
    assert talking.evaluate(NOTICE) == "take 1 is ready"
    assert talking.evaluate("document.getElementById('clock').ariaLive") == "off"
    assert talking.evaluate("document.getElementById('clock').tagName") != "OUTPUT"  # which tells every change
    scrub(talking, 1.0)
    talking.click("#select-from")
    scrub(talking, 2.0)
    talking.click("#select-to")
    assert talking.evaluate(NOTICE) == "0:01.0 to 0:02.0 is selected"
    assert talking.evaluate("cospeechStudio.selection") == pytest.approx([1, 2], abs=0.05)
    assert "2.0" in talking.get_attribute("#scrub", "aria-valuetext")
    assert "seconds" in talking.get_attribute("#scrub", "aria-valuetext")


def test_keys_move_the_camera_delete_gestures_only_where_these_are_and_letters_can_be_turned_off(talking):
    def place() -> list[float]:
        return talking.evaluate("cospeechStudio.onScreen('head')")

    talking.locator(".gesture:not(.beat)").first.click()
    count, before = talking.evaluate(COUNT), place()
    talking.locator("#part-face").focus()
    talking.keyboard.press("Backspace")
    talking.locator("#view").focus()
    talking.keyboard.press("+")
    nearer = place()
    assert abs(nearer[1] - 0.5) > abs(before[1] - 0.5) + 0.01
    talking.keyboard.press("]")
    wait_until(talking, f"cospeechStudio.onScreen('leftHand')[0] !== {nearer[0]}")
    assert talking.evaluate(COUNT) == count
    talking.keyboard.press("?")
    talking.uncheck("#letters")
    talking.keyboard.press("Escape")
    seed = talking.evaluate("cospeechStudio.takes[0].seed")
    talking.keyboard.press("n")
    assert talking.evaluate("cospeechStudio.takes[0].seed") == seed


def test_a_finger_that_scrolls_selects_nothing_and_moves_no_gesture(talking):
    scrub(talking, 1.5)
    talking.click("#select-from")
    before = talking.evaluate("[cospeechStudio.selection, cospeechStudio.time, JSON.stringify(cospeechStudio.takes[0].plan)]")
    for selector in ("#wave", "#words", ".gesture:not(.beat)"):
        talking.evaluate(
            """selector => { const element = document.querySelector(selector), box = element.getBoundingClientRect();
            element.setPointerCapture = () => undefined;
            const send = (type, x) => element.dispatchEvent(new PointerEvent(type,
              { pointerId: 7, pointerType: 'touch', button: 0, clientX: box.left + x, clientY: box.top + 4, bubbles: true }));
            send('pointerdown', 20); send('pointermove', 60); send('pointercancel', 60); }""",
            selector,
        )
        now = talking.evaluate("[cospeechStudio.selection, cospeechStudio.time, JSON.stringify(cospeechStudio.takes[0].plan)]")
        assert now == before, selector


def test_the_licences_of_the_libraries_are_one_link_away(talking):
    libraries = json.loads((ROOT / "web" / "package.json").read_text("utf-8"))["dependencies"]
    talking.keyboard.press("?")
    link = talking.locator("#help a")
    answer = talking.request.get(talking.evaluate("link => link.href", link.element_handle()))
    assert answer.headers["content-type"].startswith("text/plain")
    assert all(f"{name} - {version} (MIT)" in answer.text() for name, version in libraries.items())
    assert answer.text().count("Permission is hereby granted") == len(libraries)


def test_the_focus_stays_on_the_page(talking):
    talking.locator(".gesture:not(.beat)").first.click()
    talking.click("#remove-gesture")
    wait_until(talking, f"cospeechStudio.takes[0].edited && {READY}")
    talking.focus("#undo")
    talking.keyboard.press("Enter")
    wait_until(talking, "!cospeechStudio.takes[0].edited")
    wait_until(talking, "document.activeElement.id === 'redo'")
