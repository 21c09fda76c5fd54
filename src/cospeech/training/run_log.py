"""The log of a training run: one JSON object per line in ``log.jsonl``, and TensorBoard's files where they are wanted."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

from ..errors import InputError
from ..files import atomic

__all__ = ["Board", "RunLog", "open_board"]


class Board(Protocol):
    """The methods of TensorBoard's ``SummaryWriter`` that are used."""

    def add_scalar(self, tag: str, scalar_value: float, global_step: int) -> None: ...
    def close(self) -> None: ...


class RunLog:
    """Appends rows to the log; before that, it drops the rows after the step from which a run continues.

    Args:
        path: of ``log.jsonl``.
        step: number of steps that are done.
        board: TensorBoard's writer, or None.
    """

    def __init__(self, path: Path, step: int, board: Board | None) -> None:
        self._board = board
        rows = []
        if path.exists():
            for line in path.read_text("utf-8", "replace").splitlines():
                with suppress(ValueError, KeyError, TypeError):  # the last line of a killed run may be half a line
                    if json.loads(line)["step"] <= step:
                        rows.append(line)
        with atomic(path) as temporary:
            temporary.write_text("".join(f"{row}\n" for row in rows), "utf-8", newline="\n")
        self._file = path.open("a", encoding="utf-8", newline="\n")

    def write(self, step: int, row: Mapping[str, Any]) -> None:
        """Write a row: ``step``, and numbers or dicts of numbers."""
        self._file.write(json.dumps({"step": step, **row}) + "\n")
        self._file.flush()
        if self._board is None:
            return
        for name, value in row.items():
            for tag, number in value.items() if isinstance(value, Mapping) else [("", value)]:
                self._board.add_scalar(f"{name}/{tag}".rstrip("/"), number, step)

    def close(self) -> None:
        self._file.close()
        if self._board is not None:
            self._board.close()


def open_board(folder: Path, step: int) -> Board:
    """TensorBoard's writer, for a run that continues after a step.

    Raises:
        InputError: TensorBoard is not installed.
    """
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        raise InputError("train.tensorboard is true, and TensorBoard is not installed", "pip install tensorboard") from None
    board: Board = SummaryWriter(str(folder / "tensorboard"), purge_step=step + 1)
    return board
