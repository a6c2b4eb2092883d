"""Numbers of detections of deep fields, and what they cost.

Idea     detections of single whole images. Minutes on a processor of 1999 cannot be compared with ours; the ratios
         between procedures can be looked at side by side (`cpu_table`), but they are properties of programs and
         machines, not of fields, and get no verdict.
Source   paper Tab. 9.
Limits   for EMLDETECT the paper gives the number of input objects of the fit. Ours is the largest number of an input
         object that gave a detection, which is at most that.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from survey_mc.paper.claims import load_claims
from survey_mc.paper.rows import StudyRows, divided
from survey_mc.paper.statistics.statistic import Evidence, NotCompared, Reading, Statistic
from survey_mc.paper.study import TEST_5
from survey_mc.paper.views import LABELS, SOFT_100, View, view_of_test_5
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

REFERENCE = "mr1_se"
INPUT_NUMBER = "BOX_ID_SRC"  # EMLDETECT's column
DETECTIONS = Reading("detections of the fit", "what the fit keeps instead of what it was given")


def evidence() -> Iterator[Evidence]:
    """The claims cpu.*."""
    for name, label in LABELS.items():
        view = view_of_test_5(SOFT_100, method=label)
        is_eml = name == "emldetect"
        about = "largest number of an input object that gave a detection" if is_eml else "detections"
        readings = (DETECTIONS,) if is_eml else ()
        yield Statistic(
            f"cpu.{name}.n_det", f"{about} in one whole image", "single images", number_of_detections, view, readings
        )
        yield NotCompared(
            f"cpu.{name}.minutes", "minutes of another machine; the ratios to MR/1+SE are in cpu_table.csv"
        )


def number_of_detections(study: StudyRows, view: View) -> FloatArray:
    """(n_fields,) detections, or input objects, of each image."""
    frame = study.detections(view.campaign, view.method, view.cell)
    field, n_fields = frame["realisation"].to_numpy(np.int64), study.n_fields(view)
    if view.reading == DETECTIONS.name or INPUT_NUMBER not in frame:
        return np.bincount(field, minlength=n_fields).astype(np.float64)
    largest = np.zeros(n_fields)
    np.maximum.at(largest, field, frame[INPUT_NUMBER].to_numpy(np.float64))
    return largest


def cpu_table(study: StudyRows) -> DataFrame:
    """CPU seconds of detection on one deep field by procedure, beside the paper's minutes, each with its ratio to
    MR/1+SE. Of this machine: no part of what a study repeats byte by byte. No rows without Test 5's journal.
    """
    import pandas as pd

    minutes = {c.id.split(".")[1]: c.published.number for c in load_claims() if c.id.endswith(".minutes")}
    rows = pd.DataFrame({"method": list(minutes), "paper_minutes": list(minutes.values())})
    rows["paper_ratio"] = rows["paper_minutes"] / minutes[REFERENCE]
    spent = _cpu_seconds(study)
    rows["cpu_s_per_field"] = [spent.get(LABELS[name], np.nan) for name in minutes]
    rows["n_fields"] = [study.results.n_fields(TEST_5) if spent else 0] * len(rows)
    reference = np.full(len(rows), spent.get(LABELS[REFERENCE], np.nan))
    rows["ratio"] = divided(rows["cpu_s_per_field"].to_numpy(np.float64), reference)
    return rows


def _cpu_seconds(study: StudyRows) -> dict[str, float]:
    """Mean CPU seconds of a deep soft field by method label."""
    if not study.results.has(TEST_5):
        return {}
    journal = study.results.run(TEST_5).journal()
    detected = journal[(journal["stage"] == "detect") & (journal["cell"] == SOFT_100)]
    sums = detected.groupby("method")[["cpu_s", "fields"]].sum()
    return {str(label): float(row["cpu_s"] / row["fields"]) for label, row in sums.iterrows() if row["fields"] > 0}
