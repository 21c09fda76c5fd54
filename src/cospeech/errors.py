"""The errors for users: each tells what is wrong, with the value, and how to mend it."""

import errno
import os
from collections.abc import Iterable
from importlib import import_module
from typing import Any

__all__ = [
    "CospeechError", "CospeechWarning", "InputError", "InternalError", "describe_extra", "find_attribute", "guess",
    "is_broken_pipe", "nearest", "say_count",
]  # fmt: skip

_LONGEST = 2000  # characters of a text [ours: longer than any list of known names]


class CospeechError(Exception):
    """Base of every error raised on purpose.

    Args:
        problem: what is wrong, with the offending value.
        hint: how to mend it; shown in brackets behind the problem.

    >>> str(InputError("no speech in 'a.wav'", "is the microphone muted?"))
    "no speech in 'a.wav' (is the microphone muted?)"
    """

    def __init__(self, problem: str, hint: str = "") -> None:
        problem, hint = _line(problem), _line(hint)
        self.problem, self.hint = problem, hint
        super().__init__(f"{problem} ({hint})" if hint else problem)


def _line(text: str) -> str:
    """A text as one line. The middle of a very long text is left out: the words of a file may have any length."""
    if "\n" in text or "\r" in text:
        text = " ".join(text.split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]} … {text[-_LONGEST // 4 :]}"


class InputError(CospeechError, ValueError):
    """A file, an option or an argument of the user cannot be used: exit code 2 on the command line."""


class InternalError(CospeechError, RuntimeError):
    """We failed although the input was fine (a helper process died, say): exit code 1."""


class CospeechWarning(UserWarning):
    """The result differs a little from what the user asked for: a line ``note: …`` on the command line."""


def is_broken_pipe(error: OSError) -> bool:
    """Whether the reader of our output has closed it; Windows calls that an invalid argument."""
    return isinstance(error, BrokenPipeError) or (os.name == "nt" and error.errno == errno.EINVAL)


def describe_extra(name: str) -> str:
    """A hint how to install an extra of the package.

    >>> describe_extra("train")
    'in a clone: pip install -e ".[train]"'
    """
    # cospeech is on no index; editable, so that `make studio` reaches it; Windows' cmd.exe knows no single quotes
    return f'in a clone: pip install -e ".[{name}]"'


def find_attribute(module: str, name: str, problem: str, hint: str) -> Any:
    """Import an attribute of somebody else's module. An error inside the module is not changed: it tells file and line.

    Raises:
        InputError: there is no such module, or it has no such attribute.
    """
    try:
        namespace = import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{module}.".startswith(f"{error.name}."):
            raise
        raise InputError(f"{problem}: {error}", hint) from None
    if not hasattr(namespace, name):
        raise InputError(f"{problem}: {module} has no {name!r}", hint)
    return getattr(namespace, name)


def nearest(word: str, choices: Iterable[str]) -> str:
    """A hint for an unknown name: the most similar choice, if there is one, and all ``choices``.

    >>> nearest("livly", ["natural", "lively"])
    "did you mean 'lively'? known: natural, lively"
    """
    names = list(choices)
    return f"{guess(word, names)}known: {', '.join(names)}"


def guess(word: str, choices: Iterable[str]) -> str:
    """The first part of a hint for an unknown name: a question with the most similar of ``choices``; empty if none is similar.

    >>> guess("livly", ["natural", "lively"])
    "did you mean 'lively'? "
    """
    from difflib import get_close_matches

    close = get_close_matches(str(word).lower(), list(choices), n=1, cutoff=0.5)  # ours: below it the guesses surprise
    return f"did you mean {close[0]!r}? " if close else ""


def say_count(number: int, noun: str, plural: str = "") -> str:
    """A number of things, for messages.

    Args:
        number: of them.
        noun: for one.
        plural: for several, if it is not the noun with an s.

    >>> say_count(1, "clip"), say_count(0, "clip"), say_count(12_000, "speech", "speeches")
    ('1 clip', '0 clips', '12000 speeches')
    """
    return f"{number} {noun if number == 1 else plural or noun + 's'}"
