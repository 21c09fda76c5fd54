"""A process of its own that draws pictures, so that several cores draw.

`cospeech.audio.worker` starts it for `cospeech.export.render.worker`. A request ``R`` is a batch of rows of float32; the answer
``P`` is the pictures, one after the other, as bare RGB bytes.
"""

from __future__ import annotations

import json

import numpy as np

from cospeech.audio.worker import requests, send
from cospeech.export.render.camera import View
from cospeech.export.render.worker import ROW, FrameRenderer, Look

__all__ = ["serve"]


def serve(look: str) -> None:
    """Draw the batches that are asked for; ``look`` is a `Look` as JSON."""
    values = json.loads(look)
    renderer = FrameRenderer(Look(values["width"], values["height"], View(**values["view"]), tuple(values["background"])))
    for _, rows in requests():
        send(b"P", renderer.draw(np.frombuffer(rows, "<f4").reshape(-1, ROW)).data.cast("B"))
