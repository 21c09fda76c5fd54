"""Flows: their weights, their graphs, and the engine that plays them frame by frame."""
