"""Classification and chance matches in the tables, the figure and the page."""

import numpy as np
import pandas as pd
import pytest
from fake_run import CELLS, METHODS, FakeMethod, FakeRun

from survey_mc.detect import DETECTORS
from survey_mc.match.chance import chance_probability
from survey_mc.report.classification_section import classification_section
from survey_mc.report.classified import BRIGHT_CENTRAL, EVERY, extent_statistics
from survey_mc.report.figures import looks
from survey_mc.report.figures.classification import classification_figure
from survey_mc.report.pieces import joined_pieces
from survey_mc.report.tables import aggregate
from survey_mc.stats.intervals import jeffreys


@pytest.fixture(scope="module")
def tables(mixed_run):
    return aggregate(mixed_run)


def row_of(tables, method, statistic, selection=EVERY, rule="nearest"):
    rows = tables["classification"].query("method == @method and statistic == @statistic and rule == @rule")
    return rows[rows["selection"] == selection].iloc[0]


def joined(run, method):
    """Detections in scope of the nearest rule with their extents."""
    matches = pd.concat(run.frames("matches", CELLS[0].label, method)).query("rule == 'nearest' and det_id >= 0")
    detections = pd.concat(run.frames("detections", CELLS[0].label, method))
    extents = detections[["realisation", "det_id", "r50_arcsec", "EXT_ML"]]
    return matches.drop(columns="r50_arcsec").merge(extents, on=["realisation", "det_id"], validate="one_to_one")


def test_confusion_is_what_a_plain_count_gives(mixed_run, tables):
    rows, row = joined(mixed_run, "EML"), row_of(tables, "EML", "EXT_ML")
    has_source = rows["status"].isin(["matched", "duplicate", "faint"])
    is_extended, is_called = has_source & (rows["kind_true"] == "extended"), rows["EXT_ML"] >= 10.0
    assert row["n_extended_as_extended"] == (is_extended & is_called).sum() > 0
    assert row["n_point_as_point"] == (has_source & (rows["kind_true"] == "point") & ~is_called).sum()
    assert row["n_spurious_as_point"] == ((rows["status"] == "spurious") & ~is_called).sum()
    n_called = row[[f"n_{name}_as_extended" for name in ("point", "extended", "blend", "spurious")]].sum()
    assert row["contamination"] == 1.0 - row["n_extended_as_extended"] / n_called
    assert (row["completeness_lower"], row["completeness_upper"]) == tuple(
        map(float, jeffreys(row["n_extended_as_extended"], is_extended.sum()))
    )


def test_bright_and_central_detections_are_a_part_of_all(mixed_run, tables):
    rows = joined(mixed_run, "EML").query("counts > 20 and offaxis_arcmin < 10")
    row = row_of(tables, "EML", "r50_arcsec", BRIGHT_CENTRAL)
    names = [c for c in row.index if c.startswith("n_") and "_as_" in c]
    known = rows["status"].isin(["blend", "spurious"]) | (rows["kind_true"] != "")
    assert row[names].sum() == known.sum() < row_of(tables, "EML", "r50_arcsec")[names].sum()


def test_procedure_with_a_stellarity_has_the_joint_cut_of_the_paper(tables):
    assert row_of(tables, "MR/1+SE", "stellarity")["auc"] == 1.0
    joint = row_of(tables, "MR/1+SE", "stellarity and r50_arcsec", BRIGHT_CENTRAL)
    assert (joint["completeness"], joint["n_point_as_extended"]) == (1.0, 0)
    assert "stellarity" not in set(tables["classification"].query("method == 'EML'")["statistic"])
    assert set(tables["classification_curve"]["statistic"]) == {"EXT_ML", "r50_arcsec", "stellarity"}


def test_run_of_points_alone_counts_those_called_extended(small_run):
    only_points = aggregate(small_run)
    row = row_of(only_points, "EML", "r50_arcsec")
    assert row["n_point_as_extended"] > 0
    assert row["false_extended"] == row["n_point_as_extended"] / (row["n_point_as_extended"] + row["n_point_as_point"])
    assert np.isnan([row["completeness"], row["auc"], row["median_extended"]]).all()
    assert len(only_points["classification_curve"]) == 0


def test_every_statistic_is_a_declared_column():
    for detector in DETECTORS.built_in:
        columns = {"r50_arcsec", *(column.name for column in detector.extra_columns)}
        assert {s.column for s in detector.extent_statistics} <= columns
        assert len(extent_statistics(detector)) >= 1


def test_procedure_that_is_gone_keeps_the_half_light_radius():
    assert [s.column for s in extent_statistics(FakeMethod("no_longer_installed", "X"))] == ["r50_arcsec"]


def test_chance_of_a_detection_is_near_the_closed_form(tables):
    rows = tables["chance_matches"].query("of == 'detections' and catalogue == 'all'")
    # sources of the whole image, detections of the inner 10′; about 300 chance matches: 4 σ are 25 %
    for row in rows.itertuples():
        assert row.chance == pytest.approx(row.closed_form, rel=0.25)
        assert row.closed_form == pytest.approx(chance_probability(row.density_per_deg2, 6.0))
        assert row.chance_lower < row.chance < row.chance_upper
    assert set(tables["chance_matches"]["rule"]) == {"nearest"}


def test_corrected_completeness_is_a_little_less_by_position_and_unknown_by_origin(tables):
    rows = tables["completeness"]
    nearest = rows[rows["rule"] == "nearest"]
    assert (nearest["completeness_corrected"] <= nearest["completeness"]).all()
    assert (nearest["completeness_corrected"] > nearest["completeness"] - 0.02).all()
    assert rows.loc[rows["rule"] == "origin", "completeness_corrected"].isna().all()


def test_claims_are_wider_than_one_sigma(tables):
    rows = tables["completeness"]
    assert (rows["lower_cp"] <= rows["lower"]).all()
    assert (rows["upper_cp"] >= rows["upper"]).all()


def test_pieces_of_any_size_find_their_detections():
    matches = pd.DataFrame({"realisation": np.repeat(np.arange(6), 3), "det_id": np.tile([0, 1, -1], 6)})
    detections = pd.DataFrame({"realisation": np.repeat(np.arange(6), 2), "det_id": np.tile([1, 0], 6)})
    detections["value"] = 10.0 * detections["realisation"] + detections["det_id"]
    for matches_cut, detections_cut in ((1, 1), (1, 4), (4, 1), (3, 2), (6, 6)):
        pieces = [
            [t[t["realisation"] // n == k] for k in range(6)]
            for t, n in ((matches, matches_cut), (detections, detections_cut))
        ]
        values = np.concatenate([j.of_detection("value") for j in joined_pieces(*(iter(p) for p in pieces))])
        expected = np.where(matches["det_id"] < 0, np.nan, 10.0 * matches["realisation"] + matches["det_id"])
        assert values == pytest.approx(expected, nan_ok=True)


def test_missing_detections_are_not_known():
    matches = pd.DataFrame({"realisation": [0, 1], "det_id": [0, 0]})
    (piece,) = joined_pieces(iter([matches]), iter([]))
    assert np.isnan(piece.of_detection("r50_arcsec")).all()


def test_section_has_the_confusion_numbers(mixed_run, tables):
    text = classification_section(mixed_run, tables)
    row = row_of(tables, "EML", "EXT_ML", BRIGHT_CENTRAL)
    n = row["n_extended_as_extended"] + row["n_extended_as_point"]
    assert "EXT_ML ≥ 10.0" in text
    assert "joint cut" in text
    assert f"<td>{row['n_extended_as_extended']} of {n}</td>" in text


def test_figure_is_drawn_where_there_are_extended_sources(mixed_run, small_run, tables):
    look = looks(mixed_run.methods)
    names = ("classification_curve", "classification")
    figure = classification_figure(*(tables[name] for name in names), mixed_run.cells, look, "nearest")
    assert figure.png.startswith(b"\x89PNG")
    assert "EML EXT_ML, r50_arcsec; MR/1+SE stellarity, r50_arcsec" in figure.caption
    only_points = aggregate(small_run)
    assert classification_figure(*(only_points[name] for name in names), small_run.cells, look, "nearest") is None


def test_run_without_any_field_has_no_classification():
    class NothingDone(FakeRun):
        def realisations_done(self, table, cell_label, method_label=""):
            return 0

    run = NothingDone(CELLS[:1], METHODS[:1])
    assert classification_section(run, aggregate(run)) == ""
