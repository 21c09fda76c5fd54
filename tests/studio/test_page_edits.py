"""The studio when keys come fast, takes are gone, or another tab is open: nothing is lost, nothing happens unseen."""

# ruff: noqa: F811  fixtures
from __future__ import annotations

import time
from base64 import b64encode

import pytest

from tests.studio.test_page import READY, address, chromium, drag, draws, page, talking, wav  # noqa: F401  fixtures
from tests.support.browser import scrub, wait_until

pytestmark = pytest.mark.slow
PLAN = "cospeechStudio.takes[0].plan"
COUNT = f"{PLAN}.gestures.length"


def free_gesture(page) -> dict:
    """A gesture that can be moved half a second later and touches no other."""
    gestures = page.evaluate(f"{PLAN}.gestures")
    strokes = sorted(each["stroke"] for each in gestures)
    for each in gestures:
        after = [stroke for stroke in strokes if stroke > each["stroke"]]
        if each["form"] != "superimposed-beat" and min(after, default=4.0) > each["stroke"] + 0.35:
            return each
    return pytest.skip("no gesture has room")


def drop_all(page, files: dict[str, bytes]) -> None:
    """Drop files of these names on the page, at once."""
    page.evaluate(
        """files => { const moved = new DataTransfer();
        for (const [name, bytes] of files)
          moved.items.add(new File([Uint8Array.from(atob(bytes), c => c.charCodeAt(0))], name));
        window.dispatchEvent(new DragEvent('drop', { dataTransfer: moved, cancelable: true })); }""",
        [[name, b64encode(data).decode()] for name, data in files.items()],
    )


def wait_for(page, waiting: list) -> None:
    """Wait until a request waits; the page's requests are seen while it is asked."""
    until = time.monotonic() + 10
    while not waiting:
        assert time.monotonic() < until, "nothing was asked for"
        page.evaluate("1")


def test_each_of_many_quick_keys_counts(talking):
    gesture = free_gesture(talking)
    stroke = f"{PLAN}.gestures.find(each => each.id === '{gesture['id']}').stroke"
    talking.locator(f'[data-id="{gesture["id"]}"]').focus()
    for _ in range(3):
        talking.keyboard.press("ArrowRight")
    wait_until(talking, f"Math.abs({stroke} - {gesture['stroke'] + 0.3}) < 0.02 && {READY}")
    talking.keyboard.press("Control+z")
    wait_until(talking, f"Math.abs({stroke} - {gesture['stroke'] + 0.2}) < 0.02")


def test_two_gestures_that_are_deleted_at_once_are_both_gone_and_the_focus_stays(talking):
    before = talking.evaluate(COUNT)
    names = talking.evaluate(f"{PLAN}.gestures.filter(each => each.form !== 'superimposed-beat').map(each => each.id)")
    has_focus = "document.activeElement.matches('.gesture, #add-gesture')"
    for name in (names[0], names[-1]):
        talking.locator(f'[data-id="{name}"]').focus()
        talking.keyboard.press("Delete")
    are_absent = " && ".join(f"!{PLAN}.gestures.some(each => each.id === '{name}')" for name in (names[0], names[-1]))
    wait_until(talking, f"{are_absent} && {READY}")
    assert talking.evaluate(COUNT) < before - 1
    assert talking.evaluate(has_focus)


def test_nothing_is_downloaded_before_an_edit_is_made(talking):
    talking.route("**/api/takes", lambda route: None if route.request.method == "POST" else route.continue_())
    talking.locator(".gesture:not(.beat)").first.focus()
    talking.keyboard.press("Delete")
    wait_until(talking, "cospeechStudio.takes[0].edited")
    assert talking.get_attribute("#download", "aria-disabled") == "true"
    talking.unroute("**/api/takes")


def test_the_plan_of_a_take_that_the_studio_dropped_can_be_downloaded_and_the_take_is_made_again(talking):
    talking.locator(".gesture:not(.beat)").first.focus()
    talking.keyboard.press("Delete")
    wait_until(talking, f"cospeechStudio.takes[0].edited && {READY}")
    old = talking.evaluate("cospeechStudio.takes[0].id")
    answer = {"status": 404, "json": {"problem": "this take is no longer here", "hint": ""}}
    for what in ("plan", "file?**"):
        talking.route(f"**/api/takes/{old}/{what}", lambda route: route.fulfill(**answer))
    with talking.expect_download() as download:
        talking.click("#save-plan")
    assert '"cospeech_plan"' in download.value.path().read_text("utf-8")
    talking.click("#download")
    wait_until(talking, f"cospeechStudio.takes[0].id !== '{old}' && cospeechStudio.takes[0].id !== null && {READY}")
    talking.select_option("#format", ".bvh")
    with talking.expect_download() as download:
        talking.click("#download")
    assert download.value.path().read_bytes().startswith(b"HIERARCHY")


def test_keys_of_takes_do_nothing_while_the_live_tab_is_open(talking):
    talking.locator(".gesture:not(.beat)").first.click()
    before = talking.evaluate(f"[{COUNT}, cospeechStudio.takes[0].seed]")
    talking.click("#tab-live")
    for key in ("Delete", "n", "Space"):
        talking.evaluate("document.activeElement.blur()")
        talking.keyboard.press(key)
    talking.click("#tab-make")
    assert talking.evaluate(f"[{COUNT}, cospeechStudio.takes[0].seed]") == before
    assert not talking.evaluate("cospeechStudio.playing")


def test_the_microphone_is_closed_if_the_tab_is_left_while_the_browser_asks(page):
    page.evaluate(
        """() => { const { mediaDevices } = navigator, ask = mediaDevices.getUserMedia.bind(mediaDevices);
        window.streams = [];
        mediaDevices.getUserMedia = async wanted => {
          await new Promise(done => setTimeout(done, 400));
          const stream = await ask(wanted);
          window.streams.push(stream);
          return stream; }; }"""
    )
    page.click("#tab-live")
    page.click("#live-start")
    page.click("#live-start")
    page.click("#tab-make")
    wait_until(page, "window.streams.length === 2")
    wait_until(page, "window.streams.every(stream => stream.getTracks().every(track => track.readyState === 'ended'))")


def test_a_locked_stretch_can_be_unlocked(talking):
    wave = talking.locator("#wave").bounding_box()
    drag(talking, (wave["x"] + 100, wave["y"] + 20), (wave["x"] + 300, wave["y"] + 20))
    wait_until(talking, "cospeechStudio.selection !== null")
    talking.click("#lock-stretch")
    wait_until(talking, f"{PLAN}.locked?.length === 1")
    assert talking.inner_text("#lock-stretch") == "Unlock all"
    talking.click("#lock-stretch")
    wait_until(talking, f"!{PLAN}.locked?.length")
    assert talking.inner_text("#lock-stretch") == "Lock"


def test_space_plays_after_the_slider_was_used(talking):
    scrub(talking, 1.0)
    talking.locator("#scrub").focus()
    talking.keyboard.press("Space")
    wait_until(talking, "cospeechStudio.playing")


def test_a_speech_and_its_transcript_may_be_dropped_together(page, wav, tmp_path):
    files = {"talk.srt": b"1\n00:00:00,500 --> 00:00:01,000\nhuge\n", wav.name: wav.read_bytes()}
    drop_all(page, files)
    wait_until(page, f"document.getElementById('words').textContent === 'huge' && {READY}")


def test_the_language_of_the_words_is_chosen(talking, wav):
    assert talking.locator("#language").is_disabled()
    assert talking.locator("#language-note").is_visible()
    drop_all(talking, {"talk.tsv": b"0.5\t1.0\twill\n1.0\t1.6\tvier\n"})
    wait_until(talking, f"cospeechStudio.speech.words.length === 2 && {READY}")
    label = "document.getElementById('language').selectedOptions[0].textContent"
    assert talking.evaluate(label) == "auto: not known, read as English"
    mine = talking.evaluate("cospeechStudio.takes[0].id")
    talking.select_option("#language", "de")
    wait_until(talking, f"cospeechStudio.takes[0].id !== '{mine}' && {READY}")
    assert talking.evaluate(f"[cospeechStudio.speech.language, {label}]") == ["de", "German"]
    assert {word["language"] for word in talking.evaluate(f"{PLAN}.words")} == {"de"}
    talking.route("**/language", lambda route: route.fulfill(status=422, json={"problem": "no such language", "hint": ""}))
    talking.select_option("#language", "fr")
    wait_until(talking, "document.getElementById('problem').textContent === 'no such language'")
    assert talking.evaluate(label) == "German"  # what holds
    talking.unroute("**/language")
    drop_all(talking, {"other.wav": wav.read_bytes()})
    wait_until(talking, "cospeechStudio.speech.name === 'other.wav'")
    assert talking.evaluate(label) == "auto"


def test_a_character_that_is_cut_off_is_refused(talking, shared_folder):
    whole = (shared_folder / "data" / "avatars" / "avatar_mpfb_female_arkit52_viseme15.glb").read_bytes()
    talking.set_input_files("#avatar-file", {"name": "half.glb", "mimeType": "model/gltf-binary", "buffer": whole[:400_000]})
    wait_until(talking, "document.getElementById('problem').textContent.includes('half.glb is cut off')")


def test_seeds_stay_in_their_range(talking):
    for given, seed in (("-5", "0"), ("99999999999999", "2147483647")):
        talking.fill("#seed", given)
        talking.keyboard.press("Enter")
        assert talking.input_value("#seed") == seed
    talking.click("#next-seed")
    wait_until(talking, "cospeechStudio.takes[0].seed === 0")


def test_a_gesture_gets_another_form_hand_and_size(talking):
    name = talking.evaluate(f"{PLAN}.gestures.find(each => each.form !== 'superimposed-beat').id")
    talking.locator(f'[data-id="{name}"]').dblclick(position={"x": 4, "y": 4})
    assert talking.inner_text("#title-add") == "Change the gesture"
    stroke = talking.evaluate(f"{PLAN}.gestures.find(each => each.id === '{name}').stroke")
    talking.select_option("#add-form", "big")
    talking.select_option("#add-hands", "left")
    talking.fill("#add-size", "1.5")
    talking.click("#add-dialog button[value=add]")
    mine = f"{PLAN}.gestures.find(each => each.id === '{name}')"
    wait_until(talking, f"{mine}.form === 'big' && {mine}.hands === 'left' && {mine}.size === 1.5 && {READY}")
    assert talking.evaluate(f"{mine}.stroke") == stroke
    talking.locator(f'[data-id="{name}"]').focus()
    talking.keyboard.press("Enter")
    talking.click("#change-gesture")
    talking.click("#add-dialog button[value=add]")  # nothing else: no step of undo
    wait_until(talking, "!document.querySelector('dialog[open]')")  # which has keys of its own
    talking.keyboard.press("Control+z")
    wait_until(talking, f"{mine}.form !== 'big'")


def test_an_edit_that_is_cancelled_is_taken_back(talking):
    before = talking.evaluate(COUNT)
    talking.route("**/api/takes", lambda route: None if route.request.method == "POST" else route.continue_())
    talking.locator(".gesture:not(.beat)").first.focus()
    talking.keyboard.press("Delete")
    wait_until(talking, f"{COUNT} < {before}")
    talking.locator('#cards button:has-text("Cancel")').click()
    wait_until(talking, f"{COUNT} === {before} && !cospeechStudio.takes[0].edited")
    assert talking.get_attribute("#download", "aria-disabled") == "false"


def test_a_transcript_does_not_go_to_another_speech_than_that_beside_it(talking, wav):
    talking.locator(".gesture:not(.beat)").first.focus()
    talking.keyboard.press("Delete")
    wait_until(talking, f"cospeechStudio.takes[0].edited && {READY}")
    words, questions = talking.inner_text("#words"), []
    talking.on("dialog", lambda dialog: (questions.append(dialog.message), dialog.dismiss()))
    drop_all(talking, {"other.srt": b"1\n00:00:00,500 --> 00:00:01,000\nhuge\n", "other.wav": wav.read_bytes()})
    talking.wait_for_timeout(1000)
    assert "Open another speech without them?" in questions[0]
    assert talking.inner_text("#words") == words


def test_a_transcript_under_edits_is_told(talking, tmp_path):
    talking.locator(".gesture:not(.beat)").first.focus()
    talking.keyboard.press("Delete")
    wait_until(talking, f"cospeechStudio.takes[0].edited && {READY}")
    drop_all(talking, {"words.srt": b"1\n00:00:00,500 --> 00:00:01,000\nhuge\n"})
    wait_until(talking, "document.getElementById('notice').textContent.startsWith('takes with edits keep their gestures')")
    note = "takes with edits keep their gestures: the new words plan none there; take 1 is ready"  # and not the end alone
    wait_until(talking, f"document.getElementById('notice').textContent === '{note}'")


def test_a_link_in_the_address_bar_of_an_open_page_is_followed(page):
    page.evaluate("location.hash = '#controls'")  # as the link for keyboards does: the page stays
    with page.expect_event("load"):
        page.evaluate("setTimeout(() => { location.hash = '#style=lively&seeds=5,6' }, 50)")
    wait_until(page, "document.documentElement.dataset.ready === 'true' && cospeechStudio.takes.length === 2")
    assert page.input_value("#style") == "lively"


def test_eight_takes_fit_a_phone(talking):
    for _ in range(7):
        talking.click("#add-take")
    wait_until(talking, f"cospeechStudio.takes.length === 8 && {READY}", 60)
    talking.set_viewport_size({"width": 390, "height": 780})
    cut = "[...document.querySelectorAll('.card')].filter(card => card.scrollWidth > card.clientWidth + 1).length"
    wait_until(talking, f"{cut} === 0")


def test_keys_that_move_a_slider_are_one_step_of_undo(talking):
    talking.locator("#intensity").focus()
    for _ in range(4):
        talking.keyboard.press("ArrowRight")
    wait_until(talking, "cospeechStudio.settings.intensity > 1.1")
    talking.locator("#view").focus()
    talking.keyboard.press("Control+z")
    wait_until(talking, "cospeechStudio.settings.intensity === 1")


def test_keys_select_a_stretch_and_take_its_seed_off(talking):
    """No pointer is used: the keys I and O begin and end the stretch at the current time."""
    scrub(talking, 1.0)
    talking.locator("#view").focus()
    talking.keyboard.press("i")
    wait_until(talking, "Math.abs(cospeechStudio.selection?.[0] - 1) < 0.05")
    scrub(talking, 2.5)
    talking.locator("#view").focus()
    talking.keyboard.press("o")
    wait_until(
        talking, "Math.abs(cospeechStudio.selection[0] - 1) < 0.05 && Math.abs(cospeechStudio.selection[1] - 2.5) < 0.05"
    )
    talking.click("#reseed")
    wait_until(talking, f"{PLAN}.stretches?.[0]?.seed === 1 && {READY}")
    talking.locator("#stretches button").focus()
    talking.keyboard.press("Delete")
    wait_until(talking, f"{PLAN}.stretches.every(each => each.seed == null) && {READY}")
    scrub(talking, 0.5)
    talking.locator("#view").focus()
    talking.keyboard.press("o")
    wait_until(talking, "cospeechStudio.selection[0] === 0 && Math.abs(cospeechStudio.selection[1] - 0.5) < 0.05")


def test_all_tools_are_seen_in_a_low_window(talking):
    talking.set_viewport_size({"width": 1280, "height": 620})
    scrub(talking, 1.0)
    talking.locator("#view").focus()
    talking.keyboard.press("i")
    wait_until(talking, "document.getElementById('stretch-tools').getBoundingClientRect().height > 0")
    wait_until(talking, "document.getElementById('edits').getBoundingClientRect().bottom <= 620")


def change_words_while_held(page, pattern: str, wav):
    """Hold the first answer of the studio to a request while another transcript is dropped and its motion comes.

    Returns:
        The route of the request, and the answer that it waits for.
    """
    waiting = []
    page.route(pattern, lambda route: waiting.append((route, route.fetch())), times=1)
    page.set_input_files("#speech-file", wav)
    wait_for(page, waiting)
    drop_all(page, {"talk.srt": b"1\n00:00:00,500 --> 00:00:01,000\nhuge\n"})
    wait_until(page, f"cospeechStudio.speech.words.length === 1 && {READY}")
    (pair,) = waiting
    return pair


def test_words_that_come_during_a_download_are_those_of_the_motion_that_is_shown(page, wav):
    route, answer = change_words_while_held(page, "**/api/takes/*/motion", wav)
    mine = page.evaluate("cospeechStudio.takes[0].id")
    with page.expect_event("requestfinished", lambda request: request == route.request):
        route.fulfill(response=answer)
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.evaluate("cospeechStudio.takes[0].id") == mine
    assert page.evaluate(f"{PLAN}.words.map(each => each.text)") == ["huge"]


def test_a_take_that_was_asked_for_with_other_words_is_forgotten(page, wav):
    route, answer = change_words_while_held(page, "**/api/takes", wav)
    old = answer.json()["take"]
    with page.expect_request(lambda each: each.method == "DELETE" and each.url.endswith(old), timeout=5000):
        route.fulfill(response=answer)
    assert page.evaluate("cospeechStudio.takes[0].id") != old


def test_an_edit_that_was_undone_before_it_had_motion_does_not_come_back(talking):
    talking.route("**/api/takes", lambda route: route.fulfill(json={"take": "never"}))  # is not done
    names = talking.evaluate(f"{PLAN}.gestures.filter(each => each.form !== 'superimposed-beat').map(each => each.id)")
    has = f"{PLAN}.gestures.some(each => each.id === '{{}}')"
    for name in (names[0], names[-1]):
        talking.locator(f'[data-id="{name}"]').focus()
        talking.keyboard.press("Delete")
        wait_until(talking, f"!{has.format(name)}")
    talking.keyboard.press("Control+z")
    wait_until(talking, "document.getElementById('notice').textContent === 'undone'")
    assert talking.locator(f'[data-id="{names[-1]}"]').count() == 1
    talking.locator(".gesture").first.focus()
    talking.keyboard.press("k")
    wait_until(talking, f"{PLAN}.locked?.length === 1")
    assert [talking.evaluate(has.format(name)) for name in (names[0], names[-1])] == [False, True]
    talking.unroute("**/api/takes")


def test_a_plan_of_other_settings_is_not_edited_before_it_is_made_anew(talking):
    names = talking.evaluate(f"{PLAN}.gestures.filter(each => each.form !== 'superimposed-beat').map(each => each.id)")
    old = talking.evaluate("cospeechStudio.takes[0].id")
    for name in names[:2]:
        talking.locator(f'[data-id="{name}"]').focus()
        talking.keyboard.press("k" if name == names[1] else "Delete")
    wait_until(talking, f"{PLAN}.locked?.length === 1 && cospeechStudio.takes[0].id !== '{old}' && {READY}")
    waiting = []
    talking.route("**/api/takes", lambda route: waiting.append(route), times=1)
    talking.select_option("#emotion", "anger")
    talking.locator(".gesture").last.focus()
    talking.keyboard.press("k")  # the page shows the gestures of the last settings still
    wait_until(talking, "document.getElementById('problem').textContent.includes('made anew')")
    wait_for(talking, waiting)
    waiting[0].continue_()
    wait_until(talking, f"{PLAN}.emotion === 'anger' && {READY}")
    assert not talking.evaluate(f"cospeechStudio.takes[0].edited || {PLAN}.locked?.length")
    talking.locator(".gesture").last.focus()
    talking.keyboard.press("k")
    wait_until(talking, f"cospeechStudio.takes[0].edited && {PLAN}.locked?.length === 1 && {PLAN}.emotion === 'anger'")


def test_two_quick_keys_lock_and_unlock(talking):
    waiting = []
    talking.route("**/api/plans/edit", lambda route: waiting.append(route), times=1)
    talking.locator(".gesture").first.focus()
    talking.keyboard.press("k")
    talking.keyboard.press("k")
    wait_for(talking, waiting)
    with talking.expect_response("**/api/plans/edit"):
        waiting[0].continue_()
    wait_until(talking, f"cospeechStudio.takes[0].edited && !{PLAN}.locked?.length && {READY}")


def test_the_selection_stays_where_a_value_could_not_be_moved(talking):
    row = talking.locator('.track[data-value="emotion"]').bounding_box()
    second = row["width"] / 4.0
    drag(talking, (row["x"] + 1.0 * second, row["y"] + 8), (row["x"] + 2.0 * second, row["y"] + 8))
    talking.select_option("#stretch-emotion", "anger")
    wait_until(talking, f"{PLAN}.stretches?.length === 1 && {READY}")
    before = talking.evaluate("cospeechStudio.selection")
    refusal = {"status": 422, "json": {"problem": "this stretch is locked", "hint": ""}}
    talking.route("**/api/plans/edit", lambda route: route.fulfill(**refusal))
    talking.locator(".segment").focus()
    talking.keyboard.press("ArrowRight")
    wait_until(talking, "document.getElementById('problem').textContent.includes('locked')")
    assert talking.evaluate("cospeechStudio.selection") == before
    talking.unroute("**/api/plans/edit")


@pytest.mark.parametrize(
    ("keys", "way"),
    [
        ("ArrowRight ArrowRight", 0.2),
        ("ArrowRight ArrowLeft ArrowLeft", -0.1),
        ("ArrowRight Control+z ArrowRight ArrowRight", 0.2),
        ("ArrowRight Delete", None),
    ],
)
def test_quick_keys_move_a_value_from_where_it_then_is(talking, keys, way):
    row, waiting = talking.locator('.track[data-value="emotion"]').bounding_box(), []
    second = row["width"] / 4.0
    drag(talking, (row["x"] + 1.0 * second, row["y"] + 8), (row["x"] + 2.0 * second, row["y"] + 8))
    talking.select_option("#stretch-emotion", "anger")
    wait_until(talking, f"{PLAN}.stretches?.length === 1 && {READY}")
    before = talking.evaluate(f"{PLAN}.stretches[0]")
    talking.locator(".segment").focus()
    talking.route("**/api/plans/edit", lambda route: waiting.append(route), times=1)
    for key in keys.split():
        talking.keyboard.press(key)
    wait_for(talking, waiting)
    waiting[0].continue_()
    if way is None:
        wait_until(talking, f"!{PLAN}.stretches?.length")
        return
    ends = [before["from"] + way, before["to"] + way]
    are_there = "{0}.length === {1} && Math.abs({0}[0].from - {2}) < 2e-3 && Math.abs({0}[0].to - {3}) < 2e-3"
    wait_until(talking, are_there.format(f"{PLAN}.stretches", 1, *ends))
    wait_until(talking, f"Math.abs(cospeechStudio.selection[0] - {ends[0]}) < 2e-3")
