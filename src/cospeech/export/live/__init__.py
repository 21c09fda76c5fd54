"""Send motion while the speech comes in: wire formats and receivers."""
