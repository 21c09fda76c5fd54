"""Local web pages: the server that they share, the studio, and the study with human raters."""
