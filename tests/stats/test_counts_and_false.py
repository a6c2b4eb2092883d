import numpy as np
import pandas as pd
import pytest
from stats_frames import match_rows

from survey_mc.stats import NumberCounts, StatusCounts
from survey_mc.stats.intervals import garwood

AREA_DEG2 = 0.5
ROWS = match_rows(
    8,
    status=np.array(
        ["matched", "faint", "blend", "spurious", "duplicate", "outside", "outside", "missed"], dtype=object
    ),
    det_id=[0, 1, 2, 3, 4, 5, 6, -1],
    kind_true=np.array(["point", "point", "point", "", "point", "", "point", "extended"], dtype=object),
    flux_cgs=[2e-15, 2e-15, 4e-15, 4e-15, 8e-15, 8e-15, 8e-15, np.nan],
    offaxis_arcmin=[1.0, 2.0, 3.0, 4.0, 5.0, 20.0, 9.9, np.nan],
)


def counts():
    numbers = NumberCounts(region_arcmin=10.0)
    numbers.add(ROWS)
    numbers.add_truth(pd.DataFrame({"offaxis_arcmin": [1.0, 2.0, 11.0], "flux_cgs": [2e-15, 8e-15, 8e-15]}))
    return numbers


def test_detections_inside_are_counted_whatever_they_are():
    table = counts().differential(AREA_DEG2, AREA_DEG2).set_index("flux_min_cgs")
    assert table["n_detected"].tolist() == [2, 2, 2]
    assert table["n_false"].tolist() == [1, 2, 0]
    assert table["n_input"].tolist() == [1, 0, 1]


def test_densities_are_numbers_over_the_summed_area_with_garwood_intervals():
    table = counts().differential(AREA_DEG2, AREA_DEG2)
    assert table["detected_per_deg2"].tolist() == [4.0, 4.0, 4.0]
    lower, upper = garwood(2)
    assert table["detected_per_deg2_lower"].iloc[0] == pytest.approx(lower / AREA_DEG2)
    assert table["detected_per_deg2_upper"].iloc[0] == pytest.approx(upper / AREA_DEG2)


def test_integral_is_the_sum_of_the_differential_from_above():
    numbers = counts()
    differential, integral = numbers.differential(AREA_DEG2, AREA_DEG2), numbers.integral(AREA_DEG2, AREA_DEG2)
    for name in ("n_input", "n_detected", "n_false"):
        assert integral[name].iloc[0] == differential[name].sum()
    assert integral["n_detected"].is_monotonic_decreasing
    assert integral["n_detected"].iloc[-1] == 2


def test_paper_false_are_faint_blends_and_spurious_and_not_duplicates():
    statuses = StatusCounts()
    statuses.add(ROWS)
    row = statuses.false_row(n_fields=2, area_deg2=AREA_DEG2)
    assert (row["n_detections"], row["n_false"], row["n_duplicate"], row["n_spurious"]) == (5, 3, 1, 1)
    assert (row["false_per_field"], row["false_per_deg2"], row["purity"]) == (1.5, 6.0, 0.2)
    assert row["false_per_field_upper"] == pytest.approx(garwood(3)[1] / 2)


def test_status_table_splits_by_kind_and_sums_to_all():
    statuses = StatusCounts()
    statuses.add(ROWS[:4])
    statuses.add(ROWS[4:])
    table = statuses.table(2)
    everything = table[table["kind"] == "all"].set_index("status")["n"]
    assert everything.sum() == len(ROWS)
    assert everything["outside"] == 2
    assert table.query("kind == 'extended'")[["status", "n"]].to_numpy().tolist() == [["missed", 1]]


def test_no_field_gives_no_rate():
    row = StatusCounts().false_row(0, 0.0)
    assert np.isnan([row["false_per_field"], row["false_per_deg2"], row["purity"]]).all()


def test_empty_run_gives_empty_tables():
    numbers = NumberCounts(10.0)
    assert len(numbers.differential(0.0, 0.0)) == len(numbers.integral(0.0, 0.0)) == 0
