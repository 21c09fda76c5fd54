"""Makes a bundle of a training run: graphs, statistics and facts."""

__all__: list[str] = []
