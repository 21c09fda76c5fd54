"""``python -m cospeech`` is ``cospeech``."""

from .cli.main import main

__all__: list[str] = []

main()
