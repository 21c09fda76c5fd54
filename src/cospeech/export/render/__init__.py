"""Pictures of the mannequin, without a display, a browser or a graphics card: from pose to pixels in numpy.

`cospeech.export.pictures.render_motion` draws a motion in one call.
"""

__all__: list[str] = []
