"""Figures of tables: curves, heat maps, scatters, strips of stick figures."""

__all__: list[str] = []
