"""The state of a studio server: speeches, clips, takes, and its worker processes."""

from __future__ import annotations

import threading
import warnings
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from ..errors import CospeechError, CospeechWarning
from ..files import scratch, workplace
from .catalogue import MOST_TAKES, make_catalogue
from .events import EventHub, OpenPages
from .live import LiveModels
from .messages import Catalogue
from .shelf import Shelf, TakeSource
from .speeches import HeldSpeech
from .takes import HeldTake, TakeQueue
from .uploads import Uploads
from .worker import JobCancelled, StudioWorker

__all__ = ["HeldClip", "StudioState"]

_MOST_SPEECHES, _MOST_CLIPS = 8, 16  # ours: as many as are compared side by side, and twice as many
_DISK = 2 << 30  # bytes of each shelf [ours: sixteen takes of half an hour at 60 frames per second]


@dataclass
class HeldClip(TakeSource):
    """An example of a style, in a folder of its own."""

    folder: Path
    path: Path


class StudioState:
    """The state of one server; a context manager. Its files are in a temporary folder, which is removed at the end."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        place = self._stack.enter_context(workplace(scratch()))
        self.speeches: Shelf[HeldSpeech] = Shelf("speech", place / "speeches", _MOST_SPEECHES, _DISK)
        self.clips: Shelf[HeldClip] = Shelf("clip", place / "clips", _MOST_CLIPS, _DISK)
        self.takes: Shelf[HeldTake] = Shelf("take", place / "takes", MOST_TAKES, _DISK)
        self.place, self.hub, self.uploads, self.live_models = place, EventHub(), Uploads(), LiveModels()
        self.maker, self.writer = StudioWorker(), StudioWorker()
        self._stack.callback(self.writer.close)
        self.queue = TakeQueue(self.takes, self.maker, self.hub.publish)
        self._stack.callback(self.queue.close)
        self.pages = OpenPages(self.queue.cancel_page)
        self.live_sessions = 0
        self.file_jobs = 0
        self._catalogue: Catalogue | None = None
        self._turn = threading.Lock()

    def __enter__(self) -> StudioState:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._stack.close()

    def list_catalogue(self) -> Catalogue:
        """The catalogue. The first call waits until the worker process has loaded the models.

        Raises:
            CospeechError: the worker process has ended.
        """
        with self._turn:
            if self._catalogue is None:
                facts = self.maker.run("describe")
                for text in facts["left_out"]:
                    warnings.warn(text, CospeechWarning, stacklevel=2)
                self._catalogue = make_catalogue(facts["models"])
            return self._catalogue

    def start_warm_up(self) -> None:
        """Start to load the models, so that neither the page nor the first take has to wait; returns at once."""
        threading.Thread(target=self._warm_up, name="cospeech warm-up", daemon=True).start()

    def _warm_up(self) -> None:
        with suppress(CospeechError, JobCancelled):  # the first call that needs the process reports it
            self.maker.run("warm")
            self.list_catalogue()

    def find_mannequin(self) -> Path:
        """Our mannequin as a GLB file without motion, made at the first call."""
        path = self.place / "mannequin.glb"
        with self._turn:
            if not path.exists():
                from ..export.glb import CharacterScene
                from ..export.mannequin import build

                temporary = path.with_suffix(".new")
                with temporary.open("wb") as file:
                    CharacterScene(build()).builder.write(file)
                temporary.replace(path)
        return path
