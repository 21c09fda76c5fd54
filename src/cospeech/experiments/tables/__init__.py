"""Tables of the papers, made again on a store: ``cospeech evaluate --table flow-2 --store STORE``; see docs/tables.md."""

from .making import TABLES, check_figure, draw_table, make_table, write_table
from .report import to_text
from .runs import Runs

__all__ = ["TABLES", "Runs", "check_figure", "draw_table", "make_table", "to_text", "write_table"]
