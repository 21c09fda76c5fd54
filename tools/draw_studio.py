"""Screenshots of the studio for the documentation: python tools/draw_studio.py

Needs Chromium (COSPEECH_CHROMIUM, or one that `make test` unpacked), playwright, and the studio built (make studio).
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.support.browser import open_chromium, scrub, wait_until  # noqa: E402
from tests.support.study_raters import running  # noqa: E402

MEDIA = ROOT / "docs" / "media"
DONE = "cospeechStudio.takes.every(take => take.frames > 0 && take.progress === null)"
AT = 9.15  # seconds of the example: both hands are before the body
VIEWS: tuple[tuple[str, tuple[int, int], str, int], ...] = (
    ("studio", (1360, 860), "light", 1),
    ("studio-dark", (1360, 860), "dark", 3),
    ("studio-phone", (390, 1010), "light", 1),
)
"""Name, size in pixels, colours, takes."""


def draw(browser: Any, address: str, name: str, size: tuple[int, int], scheme: str, takes: int) -> Path:
    """One screenshot of the example, as WebP."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme)
    page.goto(f"{address}#seeds={','.join(map(str, range(takes)))}")
    wait_until(page, "document.documentElement.dataset.ready === 'true'", 60)
    page.click("#example")
    wait_until(page, DONE, 120)
    scrub(page, AT)
    time.sleep(2)
    shot = MEDIA / f"{name}.png"
    page.screenshot(path=shot)
    page.close()
    with Image.open(shot) as picture:
        picture.convert("RGB").save(shot.with_suffix(".webp"), quality=82, method=6)
    shot.unlink()
    return shot.with_suffix(".webp")


def main() -> None:
    """Draw all views."""
    from cospeech.studio.app import make_app
    from cospeech.studio.state import StudioState

    with StudioState() as state, running(make_app(state), websockets=True) as port, open_chromium() as browser:
        for view in VIEWS:
            path = draw(browser, f"http://127.0.0.1:{port}/", *view)
            print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
