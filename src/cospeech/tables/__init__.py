"""Tables of the papers, made again on a store: ``cospeech evaluate --table flow-2 --store STORE``; see docs/tables.md."""

from .designs import TABLES
from .making import make_table, write_table

__all__ = ["TABLES", "make_table", "write_table"]
