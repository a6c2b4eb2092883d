"""The figures of the paper from a tiny study: all are there, their numbers are right, their bytes are the same."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from survey_mc.campaign import load_resized
from survey_mc.paper import figures
from survey_mc.paper.figures import PaperFigure, headline, pairs, rows, study_figures, write_figure
from survey_mc.paper.figures import test1 as first_test
from survey_mc.paper.figures import test3 as third_test
from survey_mc.paper.figures import test4 as fourth_test
from survey_mc.paper.figures import test5_completeness as completeness
from survey_mc.paper.figures import test5_counts as number_counts
from survey_mc.paper.figures.sheet import drawing
from survey_mc.paper.results import StudyResults
from survey_mc.paper.study import GRID, TEST_1, TEST_2, TEST_3, TEST_4, TEST_5
from survey_mc.run import run_campaign
from survey_mc.run.executors import SerialExecutor

if TYPE_CHECKING:
    from pandas import DataFrame

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
FEW = ("emldetect", "gauss_se", "mr1_se")
SIZES = {  # pixels along a side, fields
    TEST_1: (256, 2),
    TEST_2: (256, 1),
    TEST_3: (160, 3),
    TEST_4: (256, 1),
    TEST_5: (160, 2),
    GRID: (304, 1),
}
NAMES = (
    *("headline", "instruments", "test1_images", "test1_count_ratios", "test2_images", "test2_count_ratios"),
    *("test2_classification_mr1", "test2_classification_others", "test3_images", "test3_flux_recovery"),
    *("test4_images", "test4_classification_mr1", "test4_classification_gauss", "test5_image"),
    *("test5_detection_rate", "test5_detection_rate_all", "test5_differential_counts", "test5_integral_counts"),
    *("test5_photometry", "cost"),
)
LARGEST_PNG_BYTES, LARGEST_PDF_BYTES = 400_000, 500_000


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    root = tmp_path_factory.mktemp("study")
    for name, (n_pix, n_fields) in SIZES.items():
        text = (CAMPAIGNS / f"{name}.toml").read_text(encoding="utf-8")
        text = re.sub(r'name = "xmm_epic"', f'name = "xmm_epic"\nn_pix = {n_pix}', text, count=1)
        left_out = (m for m in re.findall(r'^  \{ name = "(\w+)".*$', text, re.MULTILINE) if m not in FEW)
        for method in left_out:
            text = re.sub(rf'^  \{{ name = "{method}".*\n', "", text, flags=re.MULTILINE)
        if name == GRID:  # a grid without one of the bands is a case of its own
            text = text.replace('band = ["soft", "hard"]', 'band = ["soft"]')
        path = root / f"{name}.toml"
        path.write_text(text, encoding="utf-8")
        run_campaign(load_resized(path, n_fields), root / name, SerialExecutor())
    return StudyResults(root)


class NothingFound(StudyResults):
    """The same study, as if one procedure had found nothing."""

    label = "MR/1+SE"

    def matches(self, campaign: str, method: str, rule: str = "nearest", cell: str | None = None) -> DataFrame:
        frame = super().matches(campaign, method, rule, cell)
        if method != self.label:
            return frame
        lost = frame[frame["source_id"] >= 0].copy()
        lost["status"], lost["det_id"] = "missed", -1
        for column in ("counts", "flux_cgs", "sep_arcsec", "offaxis_arcmin"):
            lost[column] = np.nan
        return lost

    def detections(self, campaign: str, method: str, cell: str | None = None) -> DataFrame:
        frame = super().detections(campaign, method, cell)
        return frame[:0] if method == self.label else frame

    def links(self, campaign: str, method: str, cell: str | None = None) -> DataFrame:
        frame = super().links(campaign, method, cell)
        return frame[:0] if method == self.label else frame


@pytest.fixture(scope="module")
def drawn(results: StudyResults) -> dict[str, PaperFigure]:
    return {figure.name: figure for figure in study_figures(results)}


def texts_of(figure: PaperFigure) -> list[str]:
    return [text.get_text() for axes in figure.figure.axes for text in axes.texts]


def test_every_figure_is_there_in_the_order_of_the_paper(drawn: dict[str, PaperFigure]) -> None:
    assert tuple(drawn) == NAMES


def test_captions_say_what_is_shown_and_of_which_campaign(drawn: dict[str, PaperFigure]) -> None:
    for name, figure in drawn.items():
        assert figure.title
        if name != "instruments":
            assert any(campaign in figure.caption for campaign in SIZES), name
        if name not in ("instruments", "headline"):
            assert "The paper's" in figure.caption or "eyond the paper" in figure.caption, name


def test_every_panel_has_something_in_it(drawn: dict[str, PaperFigure]) -> None:
    for name, figure in drawn.items():
        for axes in figure.figure.axes:
            assert not axes.axison or axes.has_data() or axes.texts, name


def test_files_are_small_and_the_same_every_time(
    results: StudyResults, drawn: dict[str, PaperFigure], tmp_path: Path
) -> None:
    again = next(iter(completeness.completeness_figures(results)))
    first = [path.read_bytes() for path in write_figure(drawn[again.name], tmp_path)]
    assert [path.read_bytes() for path in write_figure(again, tmp_path)] == first
    png, pdf = first
    assert png.startswith(b"\x89PNG")
    assert len(png) < LARGEST_PNG_BYTES
    assert pdf.startswith(b"%PDF")
    assert len(pdf) < LARGEST_PDF_BYTES
    assert b"CreationDate" not in pdf
    assert b"atplotlib" not in pdf + png


@pytest.mark.parametrize("name", ["headline", "test3_images"])
def test_figures_of_every_sort_can_be_written(name: str, drawn: dict[str, PaperFigure], tmp_path: Path) -> None:
    for path in write_figure(drawn[name], tmp_path):
        assert 5000 < path.stat().st_size < LARGEST_PNG_BYTES


def test_a_figure_without_a_canvas_can_be_written(tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    bare = PaperFigure("bare", "Bare", "Nothing in it.", Figure(figsize=(1.0, 1.0)))
    assert [path.name for path in write_figure(bare, tmp_path)] == ["bare.png", "bare.pdf"]


def test_ratio_panel_gives_mean_and_spread_of_the_first_image(
    results: StudyResults, drawn: dict[str, PaperFigure]
) -> None:
    truth = results.truth(TEST_1)
    found = results.matches(TEST_1, "MR/1+SE")
    widest = truth[(truth["realisation"] == 0) & (truth["group_sep_arcsec"] == 60.0)]
    fixed = widest[widest["source_id"] % 2 == 0]  # the layout puts the fixed member first
    ours = found[(found["realisation"] == 0) & (found["status"] == "matched")]
    ratio = [float(row.counts) / 100.0 for row in ours.itertuples() if row.source_id in set(fixed["source_id"])]
    expected = f"□ {len(ratio)}/6: {np.mean(ratio):.2f} ({np.std(ratio, ddof=1):.2f})"
    assert len(ratio) > 2
    assert texts_of(drawn["test1_count_ratios"])[-1].startswith(expected)


def test_detection_rate_is_matched_over_listed_inputs(results: StudyResults) -> None:
    label, cell_label = "EMLDETECT", results.run(TEST_5).cells[0]
    frame = results.matches(TEST_5, label, cell=cell_label)
    curve = completeness.found_fraction(frame, completeness.BINS, 2)
    edges = completeness.BINS.edges
    for place in np.flatnonzero(np.isfinite(curve.mean)):
        flux_cgs = frame["flux_true_cgs"]
        inside = frame[(flux_cgs >= edges[place]) & (flux_cgs < edges[place + 1])]
        n_found, n_missed = (int((inside["status"] == s).sum()) for s in ("matched", "missed"))
        assert n_found + n_missed >= completeness.ENOUGH
        assert curve.mean[place] == pytest.approx(n_found / (n_found + n_missed))
    assert np.isfinite(curve.mean).sum() >= 3


def test_recovery_splits_at_fifty_input_counts(results: StudyResults, drawn: dict[str, PaperFigure]) -> None:
    frame = results.matches(TEST_3, "G+SE")
    bright = frame[(frame["status"] == "matched") & (frame["counts_onaxis"] >= 50.0)]
    ratio = (bright["counts"] / bright["counts_onaxis"]).to_numpy()
    expected = f"| {ratio.mean():.2f} ({ratio.std(ddof=1):.2f})"
    assert expected in third_test.side_texts(third_test.recovery(results, "G+SE").matched)[1]
    assert any(expected in text for text in texts_of(drawn["test3_flux_recovery"]))


def test_false_bars_are_detections_without_a_listed_input(results: StudyResults) -> None:
    record = results.run(TEST_5).data.cells[0]
    status = list(results.matches(TEST_5, "G+SE", cell=record.label)["status"])
    noise, false = headline.false_per_field(results, "G+SE", record)
    assert noise == status.count("spurious") / 2
    assert false == sum(status.count(s) for s in ("spurious", "blend", "faint")) / 2


def test_integral_counts_end_with_all_sources() -> None:
    fluxes_cgs = np.array([3e-16, 3e-15, 3e-14, 5e-11])  # the last one is beyond the bins
    counted = number_counts.above(fluxes_cgs, number_counts.BINS)
    assert counted[0] == 4
    assert counted[-1] == 1


def test_a_procedure_that_found_nothing_leaves_every_figure(
    results: StudyResults, drawn: dict[str, PaperFigure]
) -> None:
    empty = NothingFound(results.root)
    again = list(study_figures(empty))
    of_its_own = {"test2_classification_mr1", "test4_classification_mr1"}
    assert {figure.name for figure in again} == set(drawn) - of_its_own
    ratios = next(figure for figure in again if figure.name == "test1_count_ratios")
    assert texts_of(ratios)[-1].startswith("□ 0/6: 0.00 (0.00)")
    with drawing():
        for figure in again:
            if figure.name in ("headline", "test1_count_ratios", "test5_photometry", "test5_detection_rate"):
                figure.figure.canvas.draw()


def test_campaigns_that_were_not_run_have_no_figures(tmp_path: Path) -> None:
    assert [figure.name for figure in study_figures(StudyResults(tmp_path))] == ["instruments"]


def test_wrong_points_pass_both_cuts(results: StudyResults) -> None:
    import pandas as pd

    cloud = pd.DataFrame(
        {
            "offaxis_arcmin": [5.0, 5.0, 5.0, 5.0, 12.0],
            "counts": [30.0, 30.0, 30.0, 10.0, 30.0],
            "r50_arcsec": [25.0, 25.0, 15.0, 25.0, 25.0],
            "stellarity": [0.05, 0.5, 0.05, 0.05, 0.05],
        }
    )
    assert fourth_test.wrong_points(cloud) == (1, 3)


def test_pairs_stand_at_the_counts_of_the_varying_member(results: StudyResults) -> None:
    members = pairs.pair_members(results.truth(TEST_1))
    assert set(members.loc[members["role"] == "fixed", "counts_in"]) == {100.0}
    varying = members[members["role"] == "varying"]
    assert (varying["counts_in"] == varying["pair_counts"]).all()
    assert first_test.MEMBERS[0].role == "fixed"


def test_thinned_clouds_keep_their_ends() -> None:
    import pandas as pd

    frame = pd.DataFrame({"x": np.arange(10_000)})
    kept = rows.thinned(frame, 100)["x"].to_numpy()
    assert len(kept) == 100
    assert (kept[0], kept[-1]) == (0, 9999)


def test_single_values_have_no_spread() -> None:
    assert rows.mean_text([]) == "0.00 (0.00)"
    assert rows.mean_text([1.5]) == "1.50 (0.00)"
    assert rows.mean_text([1.0, 2.0, np.nan]) == "1.50 (0.71)"
    assert figures.write_figure is write_figure
