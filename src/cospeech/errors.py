"""The errors that users are meant to see: what is wrong, with the value, and how to mend it."""

__all__ = ["CospeechError", "InputError", "InternalError"]


class CospeechError(Exception):
    """Base of every error raised on purpose.

    Args:
        problem: what is wrong, with the offending value.
        hint: how to mend it; shown in brackets behind the problem.

    >>> str(InputError("no speech in 'a.wav'", "is the microphone muted?"))
    "no speech in 'a.wav' (is the microphone muted?)"
    """

    def __init__(self, problem: str, hint: str = "") -> None:
        self.problem, self.hint = problem, hint
        super().__init__(f"{problem} ({hint})" if hint else problem)


class InputError(CospeechError, ValueError):
    """Something that the user gave cannot be used: exit code 2 on the command line."""


class InternalError(CospeechError, RuntimeError):
    """We failed although the input was fine (a helper process died, say): exit code 1."""
