"""Local web pages: the server that they share, and the study with human raters."""
