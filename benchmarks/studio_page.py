"""How quick is the page of the studio? python benchmarks/studio_page.py

In headless Chromium, which draws by the processor: the size of the first load, the time from dropping the example speech to the
first frame of its motion, how far the shown pose is from the sound over a minute of play, and the longest task of the page's
script while it plays. Needs Chromium (COSPEECH_CHROMIUM, or one that `make test` unpacked), playwright, and the studio built.
"""

from __future__ import annotations

import gzip
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import soundfile

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from speed import machine  # noqa: E402

from cospeech.audio.speech import example  # noqa: E402
from cospeech.studio.app import PAGE, make_app  # noqa: E402
from cospeech.studio.state import StudioState  # noqa: E402
from tests.support.browser import open_chromium, wait_until  # noqa: E402
from tests.support.study_raters import running  # noqa: E402

RUNS, SECONDS = 5, 60.0
AVATAR = (".glb", ".vrm")
FIRST = "cospeechStudio.takes[0].frames > 0 && cospeechStudio.frame >= 0"
PLAY = """async seconds => { const rows = []; let most = 0;
    const watch = new PerformanceObserver(list => {
      for (const task of list.getEntries()) most = Math.max(most, task.duration); });
    watch.observe({ type: 'longtask' });
    document.getElementById('play').click();
    await new Promise(done => { const began = performance.now(); const look = () => {
      rows.push([cospeechStudio.time, cospeechStudio.shownTime]);
      if (performance.now() - began < seconds * 1000) requestAnimationFrame(look); else done(); };
      requestAnimationFrame(look); });
    document.getElementById('play').click();
    watch.disconnect();
    return [rows, most]; }"""


def load_size(page: Any, address: str) -> float:
    """Megabytes of what the page loads, each answer compressed, without the character."""
    answers: list[Any] = []
    page.on("response", lambda answer: answers.append(answer))
    page.goto(address)
    wait_until(page, "document.documentElement.dataset.ready === 'true'", 60)
    bodies = [answer.body() for answer in answers if not answer.url.endswith(AVATAR) and "/mannequin" not in answer.url]
    return sum(len(gzip.compress(body)) for body in bodies) / 1e6


def drop_seconds(page: Any, address: str, speech: Path, run: int) -> float:
    """From the file to the first frame; each run has a seed of its own, so that nothing is there already."""
    page.goto(f"{address}?{run}#seeds={run}")
    wait_until(page, "document.documentElement.dataset.ready === 'true'", 60)
    began = time.monotonic()
    page.set_input_files("#speech-file", speech)
    wait_until(page, FIRST, 60)
    return time.monotonic() - began


def main() -> None:
    if not (PAGE / "index.html").is_file():
        raise SystemExit("the studio is not built (make studio)")
    with tempfile.TemporaryDirectory() as place, StudioState() as state, open_chromium() as browser:
        long, speech = Path(place) / "long.wav", Path(example()[0])
        samples, rate = soundfile.read(speech, dtype="float32")
        soundfile.write(long, np.resize(samples, round((SECONDS + 2) * rate)), rate)
        with running(make_app(state), websockets=True) as port:
            address, page = f"http://127.0.0.1:{port}/", browser.new_page(viewport={"width": 1280, "height": 860})
            size = load_size(page, address)
            waits = [drop_seconds(page, address, speech, run) for run in range(RUNS)]
            drop_seconds(page, address, long, RUNS)
            wait_until(page, "cospeechStudio.takes[0].progress === null", 60)
            rows, longest = page.evaluate(PLAY, SECONDS)
    times = np.array(rows)
    moving = times[times[:, 0] > 0]
    apart = 1000 * np.abs(moving[:, 0] - moving[:, 1])
    most = np.quantile(apart, 0.95)
    figures = {
        "first load, gzipped, without the character": f"{size:.2f} MB",
        "from dropping the example to its motion": f"{waits[0]:.1f} s first, then {np.median(waits[1:]):.1f} s",
        f"pose and sound over {moving[-1, 0]:.0f} s": f"95 % within {most:.0f} ms, all within {apart.max():.0f} ms",
        "longest task of the script while it plays": f"{longest:.0f} ms" if longest else "none of 50 ms or more",
    }
    print(f"{machine()}, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores\n\n| | |\n|---|---|")
    for name, value in figures.items():
        print(f"| {name} | {value} |")


if __name__ == "__main__":
    main()
