"""What the user is told."""

__all__ = ["CospeechError"]


class CospeechError(Exception):
    """An error in words for the user."""
