"""Experiments: tables and figures of the papers, and mixtures of styles. Only the command line imports this package."""

__all__: list[str] = []
