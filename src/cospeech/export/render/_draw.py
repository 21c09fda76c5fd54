"""A child process that draws pictures, so that several cores can draw.

`cospeech.audio.worker` starts it for `cospeech.export.render.worker`. A request ``R`` is a batch of rows of float32. Each row
is answered by a ``P``: the top row, the left column, the height and the width of a patch (uint32), and its RGB bytes.
"""

from __future__ import annotations

import json
import warnings

import numpy as np

from cospeech.audio.worker import requests, send
from cospeech.errors import CospeechWarning
from cospeech.export.render.camera import View
from cospeech.export.render.worker import ROW, FrameRenderer, Look

__all__ = ["serve"]


def serve(look: str) -> None:
    """Draw the requested batches; ``look`` is a `Look` as JSON."""
    values = json.loads(look)
    values |= {"view": View(**values["view"]), "background": tuple(values["background"])}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CospeechWarning)  # the parent process has warned already
        renderer = FrameRenderer(Look(**values))
    for _, rows in requests():
        for patch in renderer.draw(np.frombuffer(rows, "<f4").reshape(-1, ROW)):
            place = np.array([patch.top, patch.left, *patch.pixels.shape[:2]], "<u4")
            send(b"P", np.concatenate([place.view(np.uint8), patch.pixels.ravel()]).data)
