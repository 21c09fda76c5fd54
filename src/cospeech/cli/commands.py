"""The class of all commands: an option that takes one value is named once."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperCommand

from ..errors import InputError

__all__ = ["Commands", "OneValueCommand"]


class OneValueCommand(TyperCommand):
    """Refuses ``--style calm --style lively`` where a command has one style; one of the two would be lost."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments.

        Raises:
            InputError: an option is named twice that takes one value.
        """
        order: list[Any] = self.make_parser(ctx).parse_args(args=list(args))[2]
        for parameter in order:
            takes_one = parameter.param_type_name == "option" and not parameter.multiple and not parameter.is_flag
            if takes_one and order.count(parameter) > 1:
                option = max(parameter.opts, key=len)
                raise InputError(f"{option} is there {order.count(parameter)} times", "name it once; it takes one value")
        return super().parse_args(ctx, args)


class Commands(typer.Typer):
    """A command line, or a group of it, whose commands are `OneValueCommand`."""

    def command(self, *args: Any, **options: Any) -> Any:
        """As of `typer.Typer`."""
        return super().command(*args, **{"cls": OneValueCommand} | options)
