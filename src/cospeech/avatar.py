"""Other people's characters: VRM 1.0, VRM 0.x and plain GLB, driven by our motion.

>>> avatar = load_avatar("me.vrm")             # doctest: +SKIP
>>> print(avatar.describe())                   # doctest: +SKIP
>>> avatar.animate(motion, "me_talking.glb")   # doctest: +SKIP
"""

from .export.worn import Avatar, load_avatar

__all__ = ["Avatar", "load_avatar"]
