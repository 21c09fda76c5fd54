"""A rater of a study who watches and clicks in the real page, and videos that every Chromium plays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cospeech.studio.study.session import Trial
from tests.support.browser import wait_until

WATCH = """async () => { for (const video of document.querySelectorAll('video')) { video.muted = true; video.playbackRate = 4;
    await video.play(); await new Promise(done => video.addEventListener('ended', done, { once: true })); } }"""


def write_webm(path: Path) -> Path:
    """Eight grey pictures in a codec that every Chromium has."""
    import av
    import numpy as np

    with av.open(str(path), "w", format="webm") as container:
        video = container.add_stream("libvpx", rate=10)
        video.width = video.height = 64
        video.pix_fmt = "yuv420p"
        for k in range(8):
            picture = av.VideoFrame.from_ndarray(np.full((64, 64, 3), 30 * k, np.uint8), format="rgb24")
            container.mux(video.encode(picture))
        container.mux(video.encode(None))
    return path


def agree(page: Any) -> None:
    """Tick the box and begin."""
    wait_until(page, "document.querySelector('h1')?.textContent === 'Before you start'")
    page.check("#agree")
    page.keyboard.press("Enter")


def open_trial(page: Any, number: int, total: int) -> None:
    """Wait for a page of the study."""
    wait_until(page, f"document.querySelector('h1').textContent === 'Page {number + 1} of {total}'")


def answer(page: Any, answers: dict[tuple[str, int], int]) -> None:
    """Click the answers and go on; the videos must have been watched."""
    for (name, place), value in answers.items():
        page.check(f"fieldset[data-name='{name}'][data-place='{place}'] input[value='{value}']")
    page.click("button[type=submit]")


def take_part(page: Any, trials: tuple[Trial, ...], answers: list[dict[tuple[str, int], int]]) -> None:
    """Take part in a whole session, from the consent to the thanks."""
    agree(page)
    for number in range(len(trials)):
        open_trial(page, number, len(trials))
        page.evaluate(WATCH)
        answer(page, answers[number])
    wait_until(page, "document.querySelector('h1').textContent === 'Thank you'")
