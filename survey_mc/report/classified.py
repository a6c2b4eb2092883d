"""Tables of the classification, point against extended, of one cell, method and rule.

Idea     every column by which the procedure tells extents, with its usual cut, and the paper's joint cut where there is
         a stellarity; for all detections in the region and for the bright and central ones of the paper.
Limits   the half-light radius is tried for every procedure that fills it, whether or not it was meant to separate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.detect.detector import R50, STELLARITY, ExtentStatistic
from survey_mc.errors import SurveyError
from survey_mc.report.pieces import Joined
from survey_mc.report.source import MethodLike
from survey_mc.stats.classification import (
    EXTENDED,
    PAPER_CUT,
    POINT,
    TRUE_CLASSES,
    called_extended,
    classification_rates,
    per_area,
    rate_of,
)
from survey_mc.stats.extent_sums import MAX_GROUPS, ExtentSums, class_of, listed_by_field
from survey_mc.stats.resampling import n_field_groups
from survey_mc.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

EVERY = "all"
BRIGHT_CENTRAL = f"counts > {PAPER_CUT.counts_min:g}, off axis < {PAPER_CUT.offaxis_max_arcmin:g}′"
SELECTIONS = (EVERY, BRIGHT_CENTRAL)
JOINT = ExtentStatistic(
    "stellarity and r50_arcsec", "the paper's joint cut", 1.0,
    "Valtchanov, Pierre & Gastaud 2001, Sect. 7.3: stellarity < 0.1, r50 ≥ 20″, counts > 20, off axis < 10′",
)  # fmt: skip


def extent_statistics(method: MethodLike) -> tuple[ExtentStatistic, ...]:
    """The statistics of a procedure, and the half-light radius; only that for a procedure no longer installed."""
    from survey_mc.detect import DETECTORS

    try:
        own = DETECTORS[method.name].extent_statistics
    except SurveyError:
        own = ()
    columns = {statistic.column for statistic in own}
    joint = (JOINT,) if {STELLARITY.column, R50.column} <= columns else ()
    return (*own, *(() if R50.column in columns else (R50,)), *joint)


def detection_columns(method: MethodLike) -> tuple[str, ...]:
    """Columns of the detections that the statistics of a procedure need."""
    return (STELLARITY.column, R50.column, *(s.column for s in extent_statistics(method) if s is not JOINT))


@dataclass(slots=True)
class ClassSums:
    """All statistics of one rule, in both selections."""

    statistics: tuple[ExtentStatistic, ...]
    n_fields: int
    sums: dict[tuple[str, str], ExtentSums] = field(init=False)
    listed: dict[tuple[str, str], NDArray[np.int64]] = field(init=False)

    def __post_init__(self) -> None:
        keys = [(s, selection) for s in self.statistics for selection in SELECTIONS]
        self.sums = {(s.column, k): ExtentSums(s.cut, s.larger_is_extended, self.n_fields) for s, k in keys}
        n_groups = n_field_groups(self.n_fields, MAX_GROUPS)
        self.listed = {(s.column, k): np.zeros((n_groups, 2), dtype=np.int64) for s, k in keys}

    def add(self, joined: Joined) -> None:
        """Add the rows of this rule."""
        matches = joined.matches
        classes = class_of(matches)
        counts, offaxis = matches.numbers("counts"), matches.numbers("offaxis_arcmin")
        chosen = {EVERY: np.ones(len(matches), dtype=bool), BRIGHT_CENTRAL: PAPER_CUT.applies(counts, offaxis)}
        realisation = matches.integers("realisation")
        for statistic in self.statistics:
            values = _values(joined, statistic, counts, offaxis)
            is_called = called_extended(values, statistic.cut, statistic.larger_is_extended)
            for selection, rows in chosen.items():
                keep = rows & (classes >= 0)
                key = (statistic.column, selection)
                self.sums[key].add(values[keep], classes[keep], realisation[keep])
                n_groups = len(self.listed[key])
                self.listed[key] += listed_by_field(matches, is_called & rows, realisation % n_groups, n_groups)

    def tables(self, weights: FloatArray, area_deg2: float) -> Mapping[str, DataFrame]:
        """classification and classification_curve, without identity columns.

        weights: of `resampling.field_weights` for the groups of `ExtentSums`. area_deg2: summed over all fields.
        """
        import pandas as pd

        rows, curves = [], []
        for statistic in self.statistics:
            for selection in SELECTIONS:
                key = (statistic.column, selection)
                sums = self.sums[key]
                if sums.is_empty or sums.n_unmeasured == sums.confusion.sum():
                    continue
                rows.append(_row(statistic, selection, sums, self.listed[key], weights, area_deg2))
                if statistic is not JOINT:
                    head = {"statistic": statistic.column, "label": statistic.label, "unit": statistic.unit}
                    curves.append(sums.curve(weights).assign(**head, selection=selection))
        return {
            "classification": pd.DataFrame(rows),
            "classification_curve": pd.concat(curves, ignore_index=True) if curves else pd.DataFrame(),
        }


def _values(joined: Joined, statistic: ExtentStatistic, counts: FloatArray, offaxis_arcmin: FloatArray) -> FloatArray:
    """The statistic of each row; for the joint cut 1 where it calls the detection extended, else 0."""
    if statistic is not JOINT:
        return joined.of_detection(statistic.column)
    stellarity, r50_arcsec = (joined.of_detection(column) for column in (STELLARITY.column, R50.column))
    is_called: BoolArray = PAPER_CUT.called_extended(stellarity, r50_arcsec, counts, offaxis_arcmin)
    return np.where(np.isnan(stellarity), np.nan, is_called)


def _row(
    statistic: ExtentStatistic,
    selection: str,
    sums: ExtentSums,
    listed: NDArray[np.int64],
    weights: FloatArray,
    area_deg2: float,
) -> dict[str, object]:
    confusion: NDArray[np.int64] = sums.confusion.sum(axis=0)
    row: dict[str, object] = {
        "statistic": statistic.column,
        "label": statistic.label,
        "unit": statistic.unit,
        "cut": statistic.cut,
        "extended_is": "larger" if statistic.larger_is_extended else "smaller",
        "selection": selection,
        "n_unmeasured": sums.n_unmeasured,
    }
    for name, (as_point, as_extended) in zip(TRUE_CLASSES, confusion, strict=True):
        row |= {f"n_{name}_as_point": int(as_point), f"n_{name}_as_extended": int(as_extended)}
    rates = classification_rates(sums.confusion, weights) | {
        "listed_called": rate_of(listed[:, 0], listed[:, 1], weights)
    }
    for name, rate in rates.items():
        row |= {
            name: rate.value,
            f"{name}_lower": rate.lower,
            f"{name}_upper": rate.upper,
            f"{name}_lower_fields": rate.lower_fields,
            f"{name}_upper_fields": rate.upper_fields,
            f"{name}_design_effect": rate.design_effect,
        }
    row |= {
        "n_listed_extended": rates["listed_called"].n_tried,
        "n_listed_extended_called": rates["listed_called"].n_found,
    }
    contaminants = per_area(int(confusion[:, 1].sum() - confusion[EXTENDED, 1]), area_deg2)
    row |= dict(zip(_named("contaminants_per_deg2"), contaminants, strict=True))
    joint = (float("nan"),) * 3
    row |= dict(zip(_named("auc", "_fields"), joint if statistic is JOINT else sums.auc(weights), strict=True))
    medians = joint[:2] if statistic is JOINT else (sums.median(POINT), sums.median(EXTENDED))
    return row | dict(zip(("median_point", "median_extended"), medians, strict=True))


def _named(name: str, suffix: str = "") -> tuple[str, str, str]:
    return name, f"{name}_lower{suffix}", f"{name}_upper{suffix}"
