"""A plan of other settings than those that are shown is not edited: edits that gave way would come back with it."""

from __future__ import annotations

import pytest

from tests.studio.test_page import READY, address, chromium, draws, page, talking, wav  # noqa: F401  fixtures
from tests.studio.test_page_edits import PLAN, wait_for
from tests.support.browser import wait_until

pytestmark = pytest.mark.slow
REFUSAL = "document.getElementById('problem').textContent.includes('made anew')"


def press_k(page) -> None:  # noqa: F811
    page.locator(".gesture").last.focus()
    page.keyboard.press("k")


def remove_a_gesture(page) -> None:  # noqa: F811
    count = page.evaluate(f"{PLAN}.gestures.length")
    page.locator(".gesture").last.focus()
    page.keyboard.press("Delete")
    wait_until(page, f"cospeechStudio.takes[0].edited && {PLAN}.gestures.length < {count} && {READY}")


def check_refusal(page) -> None:  # noqa: F811
    """The edit is refused, the motion of the new settings comes, and with it the message goes."""
    wait_until(page, REFUSAL)
    assert not page.evaluate("!!cospeechStudio.takes[0].edited")
    wait_until(page, f"{PLAN}.emotion === 'anger' && {READY}", 20)
    wait_until(page, "document.getElementById('problem').textContent === ''")
    assert page.evaluate(f"!cospeechStudio.takes[0].edited && !{PLAN}.locked?.length")
    press_k(page)
    wait_until(page, f"cospeechStudio.takes[0].edited && {PLAN}.emotion === 'anger' && {READY}", 20)


@pytest.mark.parametrize("ending", ["cancelled", "failed"])
def test_a_change_whose_motion_did_not_come_is_made_before_an_edit(talking, ending):  # noqa: F811
    remove_a_gesture(talking)
    answer = {"json": {"take": "never"}} if ending == "cancelled" else {"status": 422, "json": {"problem": "no", "hint": ""}}
    talking.route("**/api/takes", lambda route: route.fulfill(**answer), times=1)
    talking.select_option("#emotion", "anger")
    if ending == "cancelled":
        wait_until(talking, "cospeechStudio.takes[0].making === 'never'")
        talking.locator("button", has_text="Cancel").first.click()
        wait_until(talking, "cospeechStudio.takes[0].progress === null")
    else:
        wait_until(talking, "cospeechStudio.takes[0].problem === 'no'")
    press_k(talking)
    check_refusal(talking)


def test_an_edit_that_is_under_way_when_a_setting_changes_is_refused(talking):  # noqa: F811
    waiting: list = []
    talking.route("**/api/plans/edit", lambda route: waiting.append(route), times=1)
    press_k(talking)
    wait_for(talking, waiting)
    talking.select_option("#emotion", "anger")
    waiting[0].continue_()
    check_refusal(talking)
