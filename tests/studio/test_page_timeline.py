"""The time line of the studio: one stop of Tab for all gestures, and a scale that keeps the place."""

# ruff: noqa: F811  fixtures
from __future__ import annotations

import re

import pytest

from tests.studio.test_page import READY, address, chromium, drag, draws, page, seek, talking, wav  # noqa: F401  fixtures
from tests.studio.test_page_edits import COUNT, PLAN, free_gesture
from tests.support.browser import find_violations, scrub, wait_until

pytestmark = pytest.mark.slow
STOPS = "[...document.querySelectorAll('#options [role=option]')].filter(each => each.tabIndex === 0).length"
FOCUSED = "document.activeElement.dataset.item"
ITEMS = "[...document.querySelectorAll('#gestures [role=option]')].map(each => each.dataset.item)"
SCALE = "document.getElementById('lanes').getBoundingClientRect().width / cospeechStudio.speech.seconds"


def time_at(page, x: float) -> float:
    """The time that is shown at ``x`` pixels from the left of the window."""
    return page.evaluate(
        "x => { const box = document.getElementById('lanes').getBoundingClientRect();"
        " return (x - box.left) / box.width * cospeechStudio.speech.seconds; }",
        x,
    )


def ruler_labels(page) -> list[str]:
    return [text for text in page.locator("#ruler span").all_inner_texts() if text]


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
    wait_until(talking, f"Math.abs({stroke} - {gesture['stroke'] + 0.1}) < 0.01 && {READY}")
    assert talking.evaluate(f"[{FOCUSED}, {STOPS}]") == [mine, 1]
    order, count = talking.evaluate(ITEMS).index(mine), talking.evaluate(COUNT)
    talking.keyboard.press("Delete")
    wait_until(talking, f"{COUNT} < {count} && {READY}")
    rest = talking.evaluate(ITEMS)
    assert talking.evaluate(f"[{FOCUSED}, {STOPS}]") == [rest[min(order, len(rest) - 1)], 1]


def test_page_keys_go_to_the_tracks_and_the_seeds(talking):
    wave = talking.locator("#wave").bounding_box()
    drag(talking, (wave["x"] + 300, wave["y"] + 20), (wave["x"] + 500, wave["y"] + 20))
    wait_until(talking, "cospeechStudio.selection !== null")
    talking.select_option("#stretch-emotion", "happiness")
    wait_until(talking, f"{PLAN}.stretches?.length === 1 && {READY}")
    talking.click("#reseed")
    wait_until(talking, f"{PLAN}.stretches[0].seed === 1 && {READY}")
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
    wait_until(talking, f"cospeechStudio.takes[0].id !== '{mine}' && {READY}", 30)
    assert talking.evaluate(f"[document.getElementById('scroller').tabIndex, {STOPS}]") == [0, 0]
    assert not find_violations(talking)


def test_signs_are_no_keys_where_letters_are_not_but_in_the_time_line(talking):
    talking.keyboard.press("?")
    talking.uncheck("#letters")
    talking.keyboard.press("Escape")
    before = talking.evaluate(SCALE)
    talking.focus("#add-take")
    for key in ("+", "?"):
        talking.keyboard.press(key)
    assert talking.evaluate(SCALE) == before
    assert not talking.locator("#help").is_visible()
    talking.locator("#options [role=option]").first.focus()
    talking.keyboard.press("+")
    assert talking.evaluate(SCALE) > before


def test_buttons_and_keys_zoom_about_the_playhead(talking):
    seek(talking, 2.0)
    talking.locator("#view").focus()
    usual = talking.evaluate(SCALE)
    assert talking.locator("#zoom-out").is_disabled()  # four seconds fit
    head = talking.locator("#playhead").bounding_box()["x"]
    for press in (lambda: talking.click("#zoom-in"), lambda: talking.keyboard.press("+"), lambda: talking.keyboard.press("=")):
        before = talking.evaluate(SCALE)
        press()
        assert talking.evaluate(SCALE) > before
        assert talking.locator("#playhead").bounding_box()["x"] == pytest.approx(head, abs=2)
        assert time_at(talking, head + 1) == pytest.approx(2.0, abs=0.02)
    assert talking.locator("#zoom-in").is_disabled()
    assert re.fullmatch(r"\d\.\d seconds are in view", talking.inner_text("#notice"))
    talking.locator("#scrub").focus()
    talking.keyboard.press("-")
    assert talking.evaluate(SCALE) < before * 1.5
    talking.keyboard.press("0")
    assert talking.evaluate(SCALE) == pytest.approx(usual)
    assert talking.evaluate(
        "document.getElementById('scroller').scrollWidth <= document.getElementById('scroller').clientWidth"
    )


def test_the_wheel_zooms_with_ctrl_about_the_pointer_and_the_ruler_follows(talking):
    wave = talking.locator("#wave").bounding_box()
    x, y = wave["x"] + 0.7 * wave["width"], wave["y"] + 20
    place, before = time_at(talking, x), talking.evaluate(SCALE)
    coarse = ruler_labels(talking)
    assert coarse[0].startswith("0:00")
    talking.mouse.move(x, y)
    talking.mouse.wheel(0, -120)
    talking.wait_for_timeout(50)
    assert talking.evaluate(SCALE) == before  # without Ctrl the page scrolls
    talking.keyboard.down("Control")
    for _ in range(3):
        talking.mouse.wheel(0, -120)
    talking.keyboard.up("Control")
    wait_until(talking, f"{SCALE} > {1.5 * before}")
    assert time_at(talking, x) == pytest.approx(place, abs=0.01)
    labels = ruler_labels(talking)
    assert all(re.fullmatch(r"0:0\d\.\d", label) for label in labels)
    marks = talking.evaluate(
        "[...document.querySelectorAll('#ruler span')].map(each => [each.textContent, each.getBoundingClientRect().left])"
    )
    for text, left in marks:
        if text:
            assert time_at(talking, left) == pytest.approx(float(text[2:]), abs=0.02)


def test_a_gesture_is_dragged_by_its_time_when_the_time_line_is_zoomed(talking):
    talking.click("#zoom-in")
    first = talking.locator("#gestures .gesture:not(.beat)").first
    name = first.get_attribute("data-id")
    first.scroll_into_view_if_needed()
    stroke = talking.evaluate(f"{PLAN}.gestures.find(each => each.id === '{name}').stroke")
    box, scale = first.bounding_box(), talking.evaluate(SCALE)
    drag(talking, (box["x"] + 8, box["y"] + 8), (box["x"] + 8 + 0.1 * scale, box["y"] + 8))
    wait_until(talking, f"cospeechStudio.takes[0].edited && {READY}")
    stroke_after = talking.evaluate(f"{PLAN}.gestures.find(each => each.id === '{name}').stroke")
    assert stroke_after - stroke == pytest.approx(0.1, abs=0.02)


def test_the_playhead_is_in_view_while_it_plays_zoomed(talking):
    for _ in range(3):
        talking.click("#zoom-in")
    in_view = """(() => { const head = document.getElementById('playhead').getBoundingClientRect();
      const view = document.getElementById('scroller').getBoundingClientRect();
      return head.left >= view.left - 1 && head.right <= view.right + 1; })()"""
    scrub(talking, 3.9)
    wait_until(talking, f"cospeechStudio.shownTime > 3.8 && {in_view}")
    scrub(talking, 0.2)
    wait_until(talking, f"cospeechStudio.shownTime < 0.3 && {in_view}")
    talking.select_option("#speed", "2")
    talking.click("#play")
    out = talking.evaluate(
        f"""new Promise(done => {{ let out = 0; const look = () => {{ if (!{in_view}) out += 1;
        if (cospeechStudio.time < 3.5) requestAnimationFrame(look); else done(out); }}; requestAnimationFrame(look); }})"""
    )
    assert out <= 1  # the frame in which the view turns over


def test_zoomed_it_fits_a_phone_in_the_dark(talking):
    talking.set_viewport_size({"width": 390, "height": 800})
    talking.emulate_media(color_scheme="dark")
    talking.locator("#zoom-in").scroll_into_view_if_needed()
    talking.click("#zoom-in")
    assert talking.evaluate("document.documentElement.scrollWidth") <= 390
    boxes = [talking.locator(f"#{name}").bounding_box() for name in ("zoom-out", "zoom-in", "zoom-fit")]
    assert all(box["x"] >= 0 and box["x"] + box["width"] <= 390 and box["height"] >= 24 for box in boxes)
    assert not find_violations(talking)


def test_names_of_tracks_and_gestures_stay_in_view_and_are_left_out_where_they_do_not_fit(talking):
    label = talking.locator("#gestures .label").first
    assert label.is_visible()
    for _ in range(3):
        talking.click("#zoom-in")
    view = talking.locator("#scroller").bounding_box()
    gesture = label.locator("xpath=..").bounding_box()
    talking.evaluate(
        "x => { document.getElementById('scroller').scrollLeft += x }", gesture["x"] + 0.3 * gesture["width"] - view["x"]
    )
    for element in (label, *talking.locator(".track .base").all()):
        box = element.bounding_box()
        assert box["x"] >= view["x"]
    label.evaluate("label => { label.parentElement.style.width = '30px' }")
    assert not label.is_visible()
