"""Speech and what is heard in it: decoding, features, words and their times, prosodic events, emotions."""

__all__: list[str] = []
