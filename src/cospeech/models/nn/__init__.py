"""Parts that networks share. Only ``models``, ``training`` and ``experiments`` may import torch."""

from __future__ import annotations

__all__: list[str] = []
