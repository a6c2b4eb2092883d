"""Aggregated tables: numbers by hand, units, files that agree."""

import io

import numpy as np
import pandas as pd
import pytest
from fake_run import CELLS, FakeRun, stub_writer

from survey_mc.report.classification_columns import CLASSIFICATION_CURVE
from survey_mc.report.table_columns import CPU_SECONDS, TABLES
from survey_mc.report.tables import aggregate, build_tables
from survey_mc.stats.intervals import garwood, jeffreys
from survey_mc.units import deg2_of_circle


@pytest.fixture(scope="module")
def tables(small_run):
    return aggregate(small_run)


@pytest.fixture(scope="module")
def matches(small_run):
    """All rows of the first method by the nearest rule."""
    rows = pd.concat(small_run.frames("matches", CELLS[0].label, "EML"))
    return rows[rows["rule"] == "nearest"]


def of_first(table):
    return table[(table["method"] == "EML") & (table["rule"] == "nearest")]


def test_every_table_has_exactly_its_declared_columns(tables):
    for table in TABLES:
        assert tuple(tables[table.name].columns) == table.names
        assert len(tables[table.name]) or table is CLASSIFICATION_CURVE  # which needs extended sources
        assert all(column.about for column in table.columns)


def test_completeness_is_what_a_plain_count_gives(tables, matches):
    rows = of_first(tables["completeness"]).query("quantity == 'flux_true_cgs'")
    scope = matches[matches["status"].isin(["matched", "missed"])]
    for row in rows.itertuples():
        inside = scope["flux_true_cgs"].between(row.lower_edge, row.upper_edge, inclusive="left")
        found = (scope["status"][inside] == "matched").sum()
        assert (row.n_true, row.n_found, row.completeness) == (inside.sum(), found, found / inside.sum())
        assert (row.lower, row.upper) == tuple(jeffreys(found, inside.sum()))
    assert rows["n_true"].sum() == len(scope)


def test_false_rates_are_numbers_over_fields_and_area(tables, matches):
    row = of_first(tables["false_detections"]).iloc[0]
    n_false = matches["status"].isin(["spurious", "blend", "faint"]).sum()
    n_fields = CELLS[0].realisations
    assert row["n_false"] == n_false
    assert row["false_per_field"] == pytest.approx(n_false / n_fields)
    assert row["false_per_deg2"] == pytest.approx(n_false / (n_fields * deg2_of_circle(10.0)))
    assert row["false_per_field_lower"] == pytest.approx(garwood(n_false)[0] / n_fields)


def test_photometry_agrees_with_numpy(tables, matches):
    row = of_first(tables["photometry"]).query("ratio == 'counts / counts_onaxis' and selection == 'all'").iloc[0]
    matched = matches[matches["status"] == "matched"]
    ratio = matched["counts"] / matched["counts_onaxis"]
    assert (row["n"], row["mean"], row["stdev"]) == (
        len(ratio),
        pytest.approx(ratio.mean()),
        pytest.approx(ratio.std()),
    )
    assert row["median"] == pytest.approx(ratio.median(), rel=0.01)


def test_positions_agree_with_numpy(tables, matches):
    row = of_first(tables["astrometry"]).query("selection == 'counts_onaxis > 50'").iloc[0]
    sep = matches.query("status == 'matched' and counts_onaxis > 50")["sep_arcsec"]
    assert (row["n"], row["rms_arcsec"]) == (len(sep), pytest.approx(np.sqrt((sep**2).mean())))


def test_integral_counts_at_the_faint_end_are_all_sources(tables, small_run):
    inside = sum((t["offaxis_arcmin"] <= 10.0).sum() for t in small_run.frames("truth", CELLS[0].label))
    assert of_first(tables["counts_integral"])["n_input"].iloc[0] == inside


def test_densities_are_numbers_over_the_area_of_all_fields(tables):
    row = of_first(tables["counts_integral"]).iloc[0]
    area_deg2 = deg2_of_circle(10.0) * CELLS[0].realisations
    for name in ("input", "detected", "false"):
        assert row[f"{name}_per_deg2"] == pytest.approx(row[f"n_{name}"] / area_deg2)
        assert row[f"{name}_per_deg2_upper"] == pytest.approx(garwood(row[f"n_{name}"])[1] / area_deg2)


def test_kinds_of_sources_have_rows_of_their_own_where_a_cell_has_both(mixed_run, tables):
    assert set(tables["completeness"]["kind"]) == {"all"}
    mixed = aggregate(mixed_run)
    for name in ("completeness", "completeness_limit", "photometry", "astrometry"):
        assert set(mixed[name]["kind"]) == {"all", "point", "extended"}
    sums = of_first(mixed["completeness"]).query("quantity == 'flux_true_cgs'").groupby("kind")[["n_true", "n_found"]]
    n = sums.sum()
    assert (n.loc["point"] + n.loc["extended"]).equals(n.loc["all"])
    assert n.loc["extended", "n_true"] > 0


def test_limit_interval_holds_the_limit(tables):
    rows = tables["completeness_limit"].query("state == 'reached'")
    assert (rows["lower"] <= rows["limit"] * 1.05).all()
    assert (rows["upper"] >= rows["limit"] * 0.95).all()


def test_files_of_both_kinds_hold_the_same_numbers(small_run, tmp_path):
    tables = build_tables(small_run, tmp_path)
    for table in TABLES:
        csv = pd.read_csv(
            tmp_path / "tables" / f"{table.name}.csv",
            comment="#",
            keep_default_na=False,
            na_values="nan",
        )
        stored = pd.read_parquet(tmp_path / "tables" / f"{table.name}.parquet")
        pd.testing.assert_frame_equal(csv, stored, check_dtype=False, rtol=1e-14)
        pd.testing.assert_frame_equal(stored, tables[table.name], check_dtype=False, check_exact=True)


def test_csv_says_unit_and_meaning_of_every_column(small_run, tmp_path):
    build_tables(small_run, tmp_path, stub_writer)
    text = (tmp_path / "tables" / "counts_differential.csv").read_text()
    assert "# flux_min_cgs [erg / (s cm2)]: lower edge of the bin" in text
    comments = [line for line in text.splitlines() if line.startswith("#")]
    header = pd.read_csv(io.StringIO(text), comment="#", nrows=0)
    assert len(comments) == 1 + len(header.columns)


def test_cost_is_summed_and_kept_out_of_the_reproducible_tables(small_run, tmp_path):
    tables = build_tables(small_run, tmp_path, stub_writer)
    assert tuple(tables["cpu_seconds"].columns) == CPU_SECONDS.names
    row = tables["cpu_seconds"].query("method == 'EML' and stage == 'detect'").iloc[0]
    assert row["cpu_s_per_field"] == pytest.approx(0.05)
    assert (tmp_path / "runs" / "cpu_seconds.csv").is_file()
    assert not list((tmp_path / "tables").glob("cpu_seconds*"))


def test_same_run_gives_the_same_tables(small_run, tables):
    again = aggregate(small_run)
    for name, frame in tables.items():
        pd.testing.assert_frame_equal(frame, again[name])


def test_method_without_results_has_no_rows(small_run):
    class NothingDone(FakeRun):
        def realisations_done(self, table, cell_label, method_label=""):
            return 0

    tables = aggregate(NothingDone(small_run.cells, small_run.methods))
    assert all(len(frame) == 0 for frame in tables.values())
    assert tuple(tables["completeness"].columns) == TABLES[0].names
