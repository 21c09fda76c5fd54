"""Styles: what a user names, what a model knows of a style, and how a style changes while speech comes in."""
