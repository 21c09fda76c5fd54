"""The time line of the studio: one stop of Tab for all gestures."""

# ruff: noqa: F811  fixtures
from __future__ import annotations

import pytest

from tests.studio.test_page import DONE, address, chromium, drag, page, talking, wav  # noqa: F401  fixtures
from tests.studio.test_page_edits import COUNT, PLAN, free_gesture
from tests.support.browser import find_violations, wait_until

pytestmark = pytest.mark.slow
STOPS = "[...document.querySelectorAll('#options [role=option]')].filter(each => each.tabIndex === 0).length"
FOCUSED = "document.activeElement.dataset.item"
ITEMS = "[...document.querySelectorAll('#gestures [role=option]')].map(each => each.dataset.item)"


def test_tab_stops_once_at_the_gestures_and_keys_go_between_them(talking):
    items = talking.evaluate(ITEMS)
    assert len(items) > 2
    assert talking.evaluate(STOPS) == 1
    talking.focus("#frame")
    talking.keyboard.press("Tab")
    assert talking.evaluate(FOCUSED) == items[0]
    talking.keyboard.press("ArrowDown")
    assert talking.evaluate(f"[{FOCUSED}, {STOPS}]") == [items[1], 1]
    assert talking.get_attribute(f'[data-item="{items[1]}"]', "aria-selected") == "true"
    talking.keyboard.press("End")
    assert talking.evaluate(FOCUSED) == items[-1]
    talking.keyboard.press("ArrowUp")
    assert talking.evaluate(FOCUSED) == items[-2]
    talking.keyboard.press("Home")
    talking.keyboard.press("ArrowUp")
    assert talking.evaluate(FOCUSED) == items[0]
    assert talking.evaluate("cospeechStudio.time") == 0
    talking.keyboard.press("ArrowDown")
    talking.keyboard.press("Tab")
    assert talking.evaluate("document.activeElement.id") == "add-gesture"
    talking.keyboard.press("Shift+Tab")
    assert talking.evaluate(FOCUSED) == items[1]


def test_the_stop_stays_at_a_gesture_that_is_edited_and_goes_on_from_one_that_is_deleted(talking):
    gesture = free_gesture(talking)
    mine = f"gesture {gesture['id']}"
    talking.locator(f'[data-item="{mine}"]').focus()
    talking.keyboard.press("ArrowRight")
    stroke = f"{PLAN}.gestures.find(each => each.id === '{gesture['id']}').stroke"
    wait_until(talking, f"Math.abs({stroke} - {gesture['stroke'] + 0.1}) < 0.01 && {DONE}")
    assert talking.evaluate(f"[{FOCUSED}, {STOPS}]") == [mine, 1]
    order, count = talking.evaluate(ITEMS).index(mine), talking.evaluate(COUNT)
    talking.keyboard.press("Delete")
    wait_until(talking, f"{COUNT} < {count} && {DONE}")
    rest = talking.evaluate(ITEMS)
    assert talking.evaluate(f"[{FOCUSED}, {STOPS}]") == [rest[min(order, len(rest) - 1)], 1]


def test_page_keys_go_to_the_tracks_and_the_seeds(talking):
    wave = talking.locator("#wave").bounding_box()
    drag(talking, (wave["x"] + 300, wave["y"] + 20), (wave["x"] + 500, wave["y"] + 20))
    wait_until(talking, "cospeechStudio.selection !== null")
    talking.select_option("#stretch-emotion", "happiness")
    wait_until(talking, f"{PLAN}.stretches?.length === 1 && {DONE}")
    talking.click("#reseed")
    wait_until(talking, f"{PLAN}.stretches[0].seed === 1 && {DONE}")
    assert talking.evaluate(STOPS) == 1
    talking.locator("#options [role=option]").first.focus()
    talking.keyboard.press("PageDown")
    assert talking.evaluate(FOCUSED) == "emotion 0"
    talking.keyboard.press("PageDown")
    assert talking.evaluate(FOCUSED).startswith("own ")
    talking.keyboard.press("PageDown")
    assert talking.evaluate(FOCUSED).startswith("own ")
    talking.keyboard.press("PageUp")
    talking.keyboard.press("PageUp")
    assert talking.evaluate(FOCUSED).startswith("gesture ")
    assert not find_violations(talking)


def test_the_time_line_of_a_model_without_gestures_takes_the_focus_itself(talking):
    mine = talking.evaluate("cospeechStudio.takes[0].id")
    talking.select_option("#model", "mix-stage")
    wait_until(talking, f"cospeechStudio.takes[0].id !== '{mine}' && {DONE}", 30)
    assert talking.evaluate(f"[document.getElementById('scroller').tabIndex, {STOPS}]") == [0, 0]
    assert not find_violations(talking)


