"""A Chromium for tests of pages: found, started, and asked without evaluating strings in the page, which its policy forbids."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
AXE = ROOT / "tests" / "node" / "node_modules" / "axe-core" / "axe.min.js"
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
OPTIONS = [
    "--no-sandbox", "--headless=new", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--autoplay-policy=no-user-gesture-required", "--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream",
]  # fmt: skip
"""WebGL by the processor, sound without a click, and a microphone that beeps once a second."""

NO_DRAWING = """for (const name of ["Arrays", "Elements", "ArraysInstanced", "ElementsInstanced", "RangeElements"])
    WebGL2RenderingContext.prototype[`draw${name}`] = () => undefined;"""
"""A script that a page runs first: its pictures stay empty. Shaders that nobody draws with are not compiled, which takes the
processor two seconds a page."""


def find_chromium() -> str:
    """The path of a Chromium; where there is none the test is skipped."""
    setting = os.environ.get("COSPEECH_CHROMIUM")
    if setting and not Path(setting).is_file():
        pytest.fail(f"COSPEECH_CHROMIUM={setting} does not exist")
    ours = ROOT / "tests" / "node" / "node_modules" / ".chromium" / "chromium"
    path = setting or next(filter(None, map(shutil.which, NAMES)), None) or (str(ours) if ours.is_file() else None)
    if not path:
        pytest.skip("needs Chromium: COSPEECH_CHROMIUM is not set, and none is on PATH (`make test` unpacks one)")
    return path


@contextmanager
def open_chromium() -> Iterator[Any]:
    """A browser of Playwright."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright (the group dev)")
    path = find_chromium()
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, headless=True, args=OPTIONS)
        yield browser
        browser.close()


def wait_until(page: Any, expression: str, seconds: float = 10.0) -> Any:
    """Ask until the answer is true, and return it."""
    until = time.monotonic() + seconds
    while not (answer := page.evaluate(expression)):
        if time.monotonic() > until:
            pytest.fail(f"not within {seconds:g} s: {expression}")
        time.sleep(0.02)
    return answer


def scrub(page: Any, seconds: float) -> None:
    """Drag the slider of the time to a place."""
    page.evaluate(
        """at => { const slider = document.getElementById('scrub');
        slider.valueAsNumber = at;
        slider.dispatchEvent(new Event('input')); }""",
        seconds,
    )


def find_violations(page: Any) -> list[str]:
    """What axe finds wrong with a page: one line each, with the places."""
    if not AXE.is_file():
        pytest.skip("needs axe-core: tests/node/node_modules is not installed (`make test` does)")
    page.evaluate(AXE.read_text("utf-8"))
    report = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
    return [f"{each['id']}: {[node['html'][:120] for node in each['nodes'][:3]]}" for each in report["violations"]]
