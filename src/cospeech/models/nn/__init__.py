"""Parts that networks share; the only packages that may import torch are this one, ``models`` and ``train``."""

from __future__ import annotations

__all__: list[str] = []
