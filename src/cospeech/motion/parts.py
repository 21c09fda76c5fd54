"""Parts of a character: their names in options, files and models."""

__all__ = ["PARTS"]

PARTS = ("face", "body", "hands")
"""Parts that can be generated alone or together."""
