"""Parts of a character, as options, files and models name them."""

__all__ = ["PARTS"]

PARTS = ("face", "body", "hands")
"""What can be generated alone or together."""
