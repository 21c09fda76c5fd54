"""TED: the corpus read as it lies on disk, and written in the same layout."""

__all__: list[str] = []
