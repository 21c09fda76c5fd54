"""The queue of takes: what it needs stays, and no error ends it."""

from __future__ import annotations

import subprocess
import threading
from queue import Queue

import pytest

from cospeech.errors import InternalError
from cospeech.studio.shelf import Shelf
from cospeech.studio.speeches import HeldSpeech
from cospeech.studio.state import HeldClip
from cospeech.studio.takes import TakeQueue
from cospeech.studio.worker import StudioWorker

WAIT = 10  # seconds after which a test that hangs fails


class Maker:
    """In place of the worker process: it waits for ``start``, then calls ``make`` for each take."""

    def __init__(self, make):
        self.make, self.start, self.process_id, self.cancel = make, threading.Event(), None, lambda owner: None
        self.close = self.start.set

    def run(self, job, progress=None, owner=None, **values):
        if job == "warm":
            raise OSError(12, "Cannot allocate memory")
        assert self.start.wait(WAIT)
        self.make(**values)
        return {"seconds": 1.0, "realtime_factor": 0.1}


@pytest.fixture
def open_queue(tmp_path):
    """Open a queue whose takes are made by a function; returns the queue, its maker and its events that end a take."""
    queues = []

    def open_queue(make):
        events, maker = Queue(), Maker(make)
        takes = Shelf("take", tmp_path / "takes", 32, 1 << 30)
        queues.append(TakeQueue(takes, maker, lambda event: events.put(event) if event.type != "queued" else None))
        return queues[-1], maker, events

    yield open_queue
    for queue in queues:
        queue.close()


def add_take(queue, speech, *clip, **job):
    name, folder = queue._shelf.make_folder()
    queue.add(name, folder, speech, job, None, *clip)


def add_speech(shelf):
    name, folder = shelf.make_folder()
    (folder / "upload").write_bytes(b"sound")
    shelf.put(name, HeldSpeech(folder, "a.wav", folder / "upload", 1.0, []))
    return shelf.find(name)


@pytest.mark.parametrize("error", [OSError(12, "Cannot allocate memory"), ZeroDivisionError("division by zero")])
def test_an_error_of_any_kind_costs_its_take_alone(tmp_path, open_queue, error):
    errors = [error]

    def make():
        if errors:
            raise errors.pop()

    queue, maker, events = open_queue(make)
    speech = add_speech(Shelf("speech", tmp_path / "speeches", 8, 1 << 30))
    for _ in range(3):
        add_take(queue, speech)
    maker.start.set()
    ends = [events.get(timeout=WAIT) for _ in range(3)]
    assert [end.type for end in ends] == ["error", "done", "done"]
    assert error.args[-1] in ends[0].problem
    assert ends[0].hint


def test_a_worker_that_cannot_start_is_an_error_with_a_hint(monkeypatch):
    def refuse(*_, **__):
        raise OSError(12, "Cannot allocate memory")

    monkeypatch.setattr(subprocess, "Popen", refuse)
    with pytest.raises(InternalError, match=r"the worker process cannot start: .*memory \(close other programs"):
        StudioWorker().run("warm")


def test_speech_and_clip_stay_while_a_take_of_them_waits(tmp_path, open_queue):
    speeches, clips = (Shelf(name, tmp_path / name, 8, 1 << 30) for name in ("speech", "clip"))
    queue, maker, events = open_queue(lambda paths=(): [path.read_bytes() for path in paths])
    speech = add_speech(speeches)
    name, folder = clips.make_folder()
    clip = HeldClip(folder, folder / "clip.bvh")
    clip.path.write_bytes(b"HIERARCHY")
    clips.put(name, clip)
    add_take(queue, add_speech(speeches))  # it is made, and the next one waits
    add_take(queue, speech, clip, paths=(speech.upload, clip.path))
    for _ in range(8):
        add_speech(speeches)
        name, folder = clips.make_folder()
        clips.put(name, HeldClip(folder, folder / "clip.bvh"))
    maker.start.set()
    assert [events.get(timeout=WAIT).type for _ in range(2)] == ["done", "done"]
    add_speech(speeches)  # the limit holds again: both takes are done
    assert not speech.folder.exists()
    assert len(speeches.things) == 8


def test_if_all_are_in_use_more_than_the_limit_are_kept(tmp_path, open_queue):
    speeches = Shelf("speech", tmp_path / "speech", 2, 1 << 30)
    queue, maker, events = open_queue(lambda: None)
    for _ in range(4):
        add_take(queue, add_speech(speeches))
    assert len(speeches.things) == 4
    maker.start.set()
    assert [events.get(timeout=WAIT).type for _ in range(4)] == ["done"] * 4
    add_speech(speeches)
    assert len(speeches.things) == 2
