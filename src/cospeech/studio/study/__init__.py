"""A study with human raters: made from clips, answered on a page, reported."""

from .make import make_study
from .plan import StudyPlan, load_plan
from .report import report_study

__all__ = ["StudyPlan", "load_plan", "make_study", "report_study"]
