"""How often each procedure detects the clusters of Test 4: what the paper's main conclusion is about.

Idea     the fraction of images with a detection within 20″ of the cluster, with its Jeffreys interval. Tab. 7 of the
         paper is one draw of it; its rows beside ours hold only for images with a detection.
Source   paper Sect. 9: clusters of moderate luminosity are detected at redshifts from 1.5 to 2.
"""

from __future__ import annotations

from survey_mc.paper.results import StudyResults
from survey_mc.paper.rows import StudyRows
from survey_mc.paper.statistics.test4 import REDSHIFTS, detected
from survey_mc.paper.study import TEST_4
from survey_mc.paper.views import LABELS, View
from survey_mc.report.markup import Html, join, tag
from survey_mc.report.numbers import between
from survey_mc.report.page_shell import plain_table
from survey_mc.stats import jeffreys


def detected_clusters(results: StudyResults) -> Html:
    """Procedures by redshifts, as a table with intervals; nothing if Test 4 was not run whole."""
    study = StudyRows(results)
    views = [View(TEST_4, (label,)) for label in LABELS.values()]
    if any(study.lack(view) for view in views):
        return Html("")
    rows: list[list[object]] = []
    for view in views:
        cells: list[object] = [view.method]
        for redshift in REDSHIFTS:
            found = detected(study, view, redshift)
            lower, upper = (float(end) for end in jeffreys(int(found.sum()), len(found)))
            cells.append(join([f"{found.mean():.2f}", tag("br"), tag("small", between(lower, upper))]))
        rows.append(cells)
    note = tag(
        "p",
        f"Fraction of {len(found)} images with a detection within 20″ of a cluster of 2.8 × 10⁴⁴ erg/s (10 ks), random "
        "inside 8′; 68 % intervals. By chance a 20″ circle has a point source of the input list in one of seven.",
    )
    return join([note, plain_table(("procedure", *(f"z = {redshift:g}" for redshift in REDSHIFTS)), rows)])
