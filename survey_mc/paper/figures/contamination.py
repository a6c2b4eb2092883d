"""Contamination against completeness of the extended class in Test 4, when the cut of each statistic moves.

Idea     left the two statistics of the mixed procedures, right those of the others; a symbol marks the usual cut.
Source   the statistics of paper Sect. 3.5; the paper judges them by eye.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from survey_mc.paper.figures.paper_figure import PaperFigure
from survey_mc.paper.figures.rows import procedures
from survey_mc.paper.figures.sheet import DASHED, DOTTED, drawing, handle, legend_below, sheet
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import TEST_4
from survey_mc.report.classified import BRIGHT_CENTRAL

if TYPE_CHECKING:
    from pandas import DataFrame

TABLES = ("classification", "classification_curve")
RULE = "origin"  # what a detection is, its photons say
PANELS = (
    ("mixed procedures", ("gauss_se", "mr1_se"), ("stellarity", "r50_arcsec")),
    ("the others", ("emldetect", "wavdetect", "ewavelet"), ("EXT_ML", "PSFRATIO", "EXTENT")),
)
LINE_OF: dict[str, Any] = {"r50_arcsec": DASHED}
ENOUGH_CALLED = 20  # fewer called extended say nothing about their contamination


def contamination_figure(results: StudyResults) -> PaperFigure | None:
    """Two panels; None where the tables of Test 4 are not made."""
    run = results.run(TEST_4)
    if not set(TABLES) <= set(run.tables):
        return None
    cuts, curves = (_chosen(run.table(name)) for name in TABLES)
    curves = curves[curves["n_extended_called"] + curves["n_other_called"] >= ENOUGH_CALLED]
    known = [p for p in procedures(results, TEST_4) if (curves["method"] == p.label).any()]
    with drawing():
        figure, grid = sheet((1, 2), (3.6, 3.3), margins=(0.65, 0.15, 0.35, 1.15), gaps=(0.25, 0.2), share_y="row")
        for axes, (title, names, statistics) in zip(grid.flat, PANELS, strict=True):
            for procedure in (p for p in known if p.name in names):
                for statistic in statistics:
                    curve, cut = (_of(table, procedure.label, statistic) for table in (curves, cuts))
                    if len(curve):
                        _draw(axes, curve, cut, procedure.look, LINE_OF.get(statistic, "-"))
            axes.set_title(title, loc="left")
            axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), xlabel="completeness of the extended")
            axes.axhline(0.1, color="#777777", lw=0.8, ls=DOTTED)
        grid[0, 0].set_ylabel("contamination")
        handles = [handle(p.label, color=p.look.colour, marker=p.look.marker, ls="-") for p in known if _drawn(p.name)]
        handles += [
            handle("R50", color="#444444", ls=DASHED),
            handle("stellarity, EXT_ML, PSFRATIO, EXTENT", color="#444444", ls="-"),
        ]
        legend_below(figure, handles, n_columns=4)
    caption = (
        f"Test 4, {results.n_fields(TEST_4)} images: of the detections called extended, the fraction that is not a "
        f"cluster, against the fraction of the detected clusters that is called so, while the cut moves "
        f"({BRIGHT_CENTRAL}; by the photons' origin). Left: stellarity index (solid) and R50 (dashed). Right: EXT_ML "
        "of EMLDETECT, PSFRATIO of WAVDETECT, EXTENT of EWAVELET. Symbols: the usual cuts, with 68 % intervals from "
        "resampled images; dotted: 10 %. Pieces of a cluster that a procedure splits count as clusters. Beyond the "
        "paper, which shows the statistics only. Numbers: test4_field_clusters/tables/classification_curve."
    )
    return PaperFigure("test4_contamination", "Test 4: contamination against completeness", caption, figure)


def _draw(axes: Any, curve: DataFrame, cut: DataFrame, look: Any, line: Any) -> None:
    axes.plot(curve["completeness"], curve["contamination"], color=look.colour, ls=line, lw=1.4)
    ends = [_ends(cut, name) for name in ("contamination", "completeness")]
    face = look.colour if line == "-" else "white"
    axes.errorbar(
        cut["completeness"], cut["contamination"], *ends, color=look.colour, marker=look.marker, ls="none", ms=6.0,
        elinewidth=0.9, mfc=face,
    )  # fmt: skip


def _ends(cut: DataFrame, name: str) -> list[Any]:
    """How far the interval from resampled fields goes below and above a fraction."""
    return [(cut[name] - cut[f"{name}_lower_fields"]).clip(lower=0.0),
            (cut[f"{name}_upper_fields"] - cut[name]).clip(lower=0.0)]  # fmt: skip


def _of(table: DataFrame, method: str, statistic: str) -> DataFrame:
    return table[(table["method"] == method) & (table["statistic"] == statistic)]


def _drawn(name: str) -> bool:
    return any(name in names for _, names, _ in PANELS)


def _chosen(table: DataFrame) -> DataFrame:
    return table[(table["rule"] == RULE) & (table["selection"] == BRIGHT_CENTRAL)]
