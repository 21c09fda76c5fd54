"""Experiments: tables and figures of the papers, and mixtures of styles. Nothing else imports this package."""

__all__: list[str] = []
