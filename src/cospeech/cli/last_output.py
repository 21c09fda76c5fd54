"""Commands whose last argument is the file to write. ``-o FILE`` means the same there, as in the commands that generate."""

from __future__ import annotations

from typing import Any

from ..errors import InputError
from .commands import OneValueCommand

__all__ = ["LastOutputCommand"]


class LastOutputCommand(OneValueCommand):
    """Takes the file of ``-o`` or ``--output`` as the last argument."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the file last.

        Raises:
            InputError: there is no file after the option, or the option is there twice.
        """
        end = args.index("--") if "--" in args else len(args)
        rest, files = [], []
        words = iter(args[:end])
        for word in words:
            option, sign, file = word.partition("=")
            if option == "--output" and sign:
                files.append(file)
            elif word in ("-o", "--output"):
                files.append(next(words, ""))
            else:
                rest.append(word)
        if len(files) > 1:
            raise InputError(f"-o names {len(files)} files to write", "one is written")
        if "" in files:
            raise InputError("-o without a file", "name the file to write, such as -o talk.glb")
        return super().parse_args(ctx, [*rest, *args[end:], *files])
