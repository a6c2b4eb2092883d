"""The trade between completeness and contamination, drawn from the tables of Test 4."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd

from survey_mc.paper.figures import contamination, write_figure
from survey_mc.report.classified import BRIGHT_CENTRAL


class StubResults:
    """Test 4 with two procedures whose curves are made up."""

    def __init__(self, tables: dict[str, pd.DataFrame]) -> None:
        methods = tuple(SimpleNamespace(name=n, label=label) for n, label in (("mr1_se", "M"), ("emldetect", "E")))
        self._run = SimpleNamespace(
            tables=tuple(tables),
            table=lambda name: tables[name],
            data=SimpleNamespace(methods=methods),
            methods=("M", "E"),
        )

    def run(self, campaign: str) -> SimpleNamespace:
        return self._run

    def n_fields(self, campaign: str) -> int:
        return 7


def tables() -> dict[str, pd.DataFrame]:
    rows = [
        {"method": method, "rule": rule, "selection": selection, "statistic": statistic, "completeness": c,
         "contamination": 0.5 * c, "n_extended_called": n, "n_other_called": 0}
        for method, statistic in (("M", "stellarity"), ("M", "r50_arcsec"), ("E", "EXT_ML"))
        for rule in ("nearest", "origin")
        for selection in ("all", BRIGHT_CENTRAL)
        for c, n in zip(np.linspace(0.1, 1.0, 5), (5, 30, 40, 50, 60), strict=True)
    ]  # fmt: skip
    curve = pd.DataFrame(rows)
    cut = curve[curve["completeness"] == 1.0].copy()
    for name in ("completeness", "contamination"):
        cut[f"{name}_lower_fields"], cut[f"{name}_upper_fields"] = cut[name] - 0.05, cut[name] + 0.02
    return {"classification": cut, "classification_curve": curve}


def test_each_statistic_is_a_line_without_cuts_that_call_few_extended(tmp_path):
    figure = contamination.contamination_figure(StubResults(tables()))
    assert figure is not None
    left, right = figure.figure.axes
    curves = [line.get_xydata() for line in left.lines if len(line.get_xydata()) == 4]
    assert len(curves) == 2
    assert all(np.allclose(curve[:, 1], 0.5 * curve[:, 0]) for curve in curves)
    assert all(curve[:, 0].min() > 0.3 for curve in curves)
    assert sum(len(line.get_xydata()) == 4 for line in right.lines) == 1
    assert "7 images" in figure.caption
    assert all(path.stat().st_size > 1000 for path in write_figure(figure, tmp_path))


def test_without_tables_there_is_no_figure():
    assert contamination.contamination_figure(StubResults({})) is None
