"""What a study does not have: campaigns that were not run, and fields that a procedure has not been through.

Idea     a field in which a procedure failed has no rows, like one in which it found nothing; a number that would mix
         the two is not given.
"""

from __future__ import annotations

from survey_mc.paper.results import StudyResults
from survey_mc.paper.views import View


def lack(results: StudyResults, view: View) -> str:
    """What a view needs and the study does not have, in words; empty if it has all."""
    absent = [campaign for campaign, method in view.needs if not _has(results, campaign, method, view.cells)]
    if absent:
        return f"was not run: {', '.join(dict.fromkeys(absent))}"
    parts = [
        f"{campaign} lacks {fields_of(n, method)}"
        for campaign, method in dict.fromkeys(view.needs)
        if (n := sum(results.n_lacking(campaign, method, cell) for cell in view.cells))
    ]
    return f"was not run whole: {', '.join(parts)}" if parts else ""


def lacking_fields(results: StudyResults, campaign: str) -> str:
    """The fields that procedures have not been through in any cell of a campaign, in words; empty for none."""
    run = results.run(campaign)
    lacking = {method: sum(results.n_lacking(campaign, method, cell) for cell in run.cells) for method in run.methods}
    parts = [fields_of(n, method) for method, n in lacking.items() if n]
    return f"Lacks {', '.join(parts)}." if parts else ""


def fields_of(n: int, method: str) -> str:
    """ "1 field of X" or "3 fields of X"."""
    return f"{n} field{'' if n == 1 else 's'} of {method}"


def _has(results: StudyResults, campaign: str, method: str, cells: tuple[str, ...]) -> bool:
    if not results.has(campaign):
        return False
    run = results.run(campaign)
    return method in run.methods and set(cells) <= set(run.cells)
