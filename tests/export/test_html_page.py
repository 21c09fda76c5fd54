"""Share files: one page that opens from disk without a network, and speaks."""

from __future__ import annotations

import base64
import io
import re
import time

import numpy as np
import pytest
import soundfile

from cospeech import Motion
from cospeech.audio.speech import example
from cospeech.errors import InputError
from cospeech.export import html_page
from cospeech.export.character_files import PACKED
from tests.export.test_avatar import rewrite
from tests.support.browser import find_violations, open_chromium, scrub, wait_until


def still(frames: int = 30) -> Motion:
    from cospeech.motion.skeleton import humanoid

    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (frames, len(humanoid()), 1))
    face = np.zeros((frames, 52))
    face[:, 17] = np.linspace(0, 1, frames)  # jawOpen
    return Motion(fps=30, rotations=rotations, root=np.tile([0.0, 0.955, 0.0], (frames, 1)), face=face, skeleton=humanoid())


VIEWER_FILES = ["viewer-licenses.txt", "viewer.css", "viewer.js"]


@pytest.fixture
def viewer():
    if not (html_page.VIEWER / "viewer.js").is_file():
        pytest.skip("the viewer is not built (make studio)")


def test_without_the_viewer_the_error_says_how_to_build_it(tmp_path, monkeypatch):
    monkeypatch.setattr(html_page, "VIEWER", tmp_path / "none")
    with pytest.raises(InputError, match="make studio"):
        still(2).save(tmp_path / "talk.html")
    assert not (tmp_path / "talk.html").exists()


def test_the_page_loads_nothing_and_names_are_escaped(tmp_path, monkeypatch):
    (tmp_path / "viewer.js").write_text("'</script><b>'")
    (tmp_path / "viewer.css").write_text("b { }")
    (tmp_path / "viewer-licenses.txt").write_text('provided "AS IS"</script><u>')
    monkeypatch.setattr(html_page, "VIEWER", tmp_path)
    speech = tmp_path / "<i> & talk.ogg"
    speech.write_bytes(example()[0].read_bytes())
    still(2).save(tmp_path / "talk.html", audio=speech)
    text = (tmp_path / "talk.html").read_text("utf-8")
    assert "default-src 'none'" in text
    assert "&lt;i&gt; &amp; talk" in text
    assert "<i>" not in text
    assert '<script type="text/plain" id="licenses">\nprovided "AS IS"<\\/script><u></script>' in text
    assert not re.search(r"(src|href)=", text.replace("-src ", ""))
    assert text.count("</script>") == 4  # character, sound, licences, viewer
    assert sorted(path.name for path in tmp_path.iterdir()) == ["<i> & talk.ogg", "talk.html", *VIEWER_FILES]


def test_the_sound_reaches_the_last_frame(tmp_path, monkeypatch):
    """The page's clock is that of the sound; so silence follows a speech that ends before the last frame."""
    for name in VIEWER_FILES:
        (tmp_path / name).write_text("")
    monkeypatch.setattr(html_page, "VIEWER", tmp_path)
    soundfile.write(tmp_path / "talk.wav", np.full(16_000, 0.1, np.float32), 16_000)
    still(75).save(tmp_path / "talk.html", audio=tmp_path / "talk.wav")
    sound = re.search(r'data-kind="audio/mpeg"[^>]*>([^<]*)<', (tmp_path / "talk.html").read_text("utf-8"))
    samples, rate = soundfile.read(io.BytesIO(base64.b64decode(sound[1])))
    assert len(samples) / rate == pytest.approx(2.5, abs=0.05)
    assert abs(samples[: rate // 2]).mean() > 0.05 > 50 * abs(samples[rate * 3 // 2 :]).max()


@pytest.mark.parametrize("extension", PACKED)
def test_a_character_that_the_viewer_cannot_read_is_refused_before_the_work(tmp_path, monkeypatch, extension):
    for name in VIEWER_FILES:
        (tmp_path / name).write_text("")
    monkeypatch.setattr(html_page, "VIEWER", tmp_path)
    still(2).save(tmp_path / "me.glb")
    extensions = {"extensionsUsed": [extension], "extensionsRequired": [extension]}
    rewrite(tmp_path / "me.glb", tmp_path / "packed.glb", lambda document: document.update(extensions))
    writer = html_page.Writer(tmp_path / "talk.html", skeleton=still(2).skeleton, fps=30, avatar=tmp_path / "packed.glb")
    with pytest.raises(InputError, match=f"is packed by {extension}.*export it without compression"), writer:
        pytest.fail("the work began")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["me.glb", "packed.glb", *VIEWER_FILES]


@pytest.mark.slow
def test_a_share_file_opens_offline_and_speaks(viewer, tmp_path):
    from cospeech.generate import generate_files

    speech, words = example()
    path = tmp_path / "talk.html"
    generate_files(speech, [path], transcript=words)
    assert path.stat().st_size < 4_000_000
    with open_chromium() as browser:
        context = browser.new_context(offline=True)
        page, wrong = context.new_page(), []
        page.on("console", lambda message: wrong.append(message.text))
        page.goto(path.as_uri())
        wait_until(page, "document.documentElement.dataset.ready === 'true'")
        assert page.evaluate("cospeechStudio.seconds") == pytest.approx(19.003, abs=0.005)
        licenses = page.evaluate("document.querySelector('#licenses').textContent")
        assert "three.js authors" in licenses
        assert "Permission is hereby granted" in licenses
        openings = []
        for at in np.arange(0.2, 3, 0.3):
            scrub(page, float(at))
            time.sleep(0.05)
            openings.append(page.evaluate("cospeechStudio.jawOpen()"))
        assert max(openings) > 0.2
        assert min(openings) < 0.05
        page.click("#play")
        wait_until(page, "cospeechStudio.playing && cospeechStudio.time > 3.2")
        assert not find_violations(page)
        assert not wrong
