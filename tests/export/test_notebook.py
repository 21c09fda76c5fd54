"""Motion in a notebook: a frame that plays without a network, or a strip of pictures."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from cospeech import Speech
from cospeech.errors import InputError
from cospeech.export import html_page
from tests.export.test_html_page import still, viewer  # noqa: F401  # a fixture
from tests.support.browser import open_chromium, wait_until


def test_without_the_viewer_it_is_a_strip_of_pictures(tmp_path, monkeypatch):
    monkeypatch.setattr(html_page, "VIEWER", tmp_path / "none")
    view = still(30).show()
    assert view._repr_html_() is None
    assert min(Image.open(io.BytesIO(view._repr_png_())).size) > 50


def test_the_page_is_text_of_an_attribute(tmp_path, monkeypatch):
    """Neither quotes, nor letters beyond ASCII, nor an end of the frame in the page end the attribute."""
    (tmp_path / "viewer.js").write_text("\"é</iframe>'", "utf-8")
    for name in ("viewer.css", "viewer-licenses.txt"):
        (tmp_path / name).write_text("")
    monkeypatch.setattr(html_page, "VIEWER", tmp_path)
    html = still(2).show(height=300)._repr_html_()
    assert html.isascii()
    assert "&quot;&#233;&lt;/iframe&gt;&#x27;" in html
    assert (html.count('"'), html.count("<"), "height: 300px" in html) == (10, 2, True)


@pytest.mark.parametrize("options", [{"height": 20}, {"height": 10**6}, {"audio": 3}])
def test_what_cannot_be_shown(options):
    with pytest.raises(InputError):
        still(2).show(**options)


@pytest.mark.slow
def test_a_cell_plays_the_speech(viewer):  # noqa: F811
    speech = Speech(np.full(32_000, 0.1, np.float32), 16_000)
    cell = still(60).show(speech)._repr_html_()
    with open_chromium() as browser:
        page, wrong = browser.new_page(), []
        page.on("console", lambda message: wrong.append(message.text))
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.set_content(f"<html><body>{cell}</body></html>")
        frame = page.frames[1]
        wait_until(frame, "document.documentElement.dataset.ready === 'true'")
        assert frame.evaluate("cospeechStudio.seconds") == pytest.approx(2.0, abs=0.05)
        frame.click("#play")
        wait_until(frame, "cospeechStudio.time > 0.3")
        assert not wrong
