"""Bundles: the file, what it holds, and how it is checked before anything of it runs."""
