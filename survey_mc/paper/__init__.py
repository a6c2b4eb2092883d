"""The study of Valtchanov, Pierre & Gastaud 2001, run again: campaigns, scorecard, figures, page.

Idea     `run_study` fills a folder with one run directory for each campaign, `report_study` writes from them what is
         published, `StudyResults` opens them for anybody's own analysis.
"""

from survey_mc.paper.publish import report_study
from survey_mc.paper.reproduce import StudySummary, run_study
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import StudySize

__all__ = ["StudyResults", "StudySize", "StudySummary", "report_study", "run_study"]
