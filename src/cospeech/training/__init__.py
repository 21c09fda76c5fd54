"""Training: recipes, data, the loop, runs, and their export as bundles."""

__all__: list[str] = []
