"""Motion that leaves while the speech comes in: wire formats, and those who receive them."""
