"""A training run as a bundle: graphs, statistics and facts."""

__all__: list[str] = []
