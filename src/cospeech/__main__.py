"""``python -m cospeech`` is ``cospeech``."""

from .cli import main

__all__: list[str] = []

main()
