"""Studies with human raters: make a study from clips, collect answers on a page, and report them."""

from .make import make_study
from .plan import StudyPlan, load_plan
from .report import report_study

__all__ = ["StudyPlan", "load_plan", "make_study", "report_study"]
