"""Every statistic on hand-made frames whose answer can be counted on fingers."""

import numpy as np
import pytest
from study_stub import ECF, SOFT_10, StubResults

from survey_mc.paper.rows import Moments, StudyRows, group_weights
from survey_mc.paper.statistics import Statistic, evidence_by_claim
from survey_mc.paper.study import GRID, TEST_1, TEST_2, TEST_3, TEST_4, TEST_5
from survey_mc.paper.views import SOFT_100


def value(results: StubResults, claim: str, **changes) -> np.ndarray:
    from dataclasses import replace

    statistic = evidence_by_claim()[claim]
    assert isinstance(statistic, Statistic)
    study = StudyRows(results)
    view = replace(statistic.view, **changes)
    assert study.lack(view) == ""
    return statistic.values(study, view)


def matched(field, source, counts_in, counts_out, **more):
    row = {
        "realisation": field, "status": "matched", "source_id": source, "det_id": source, "kind_true": "point",
        "counts_onaxis": counts_in, "counts_expected": counts_in / 2, "counts": counts_out, "sep_arcsec": 1.0,
        "flux_cgs": counts_out * 2 * ECF / 1e4, "flux_true_cgs": counts_in * ECF / 1e4, "offaxis_arcmin": 5.0,
    }  # fmt: skip
    return row | more


def status(field, name, **more):
    return {"realisation": field, "status": name, "offaxis_arcmin": 5.0} | more


def test_missed_and_false_are_counted_image_by_image():
    stub = StubResults(2)
    rows = [status(0, "missed"), status(0, "missed"), status(1, "spurious"), status(1, "blend"), status(1, "faint"),
            status(1, "duplicate"), status(0, "outside")]  # fmt: skip
    stub.add(TEST_1, "matches", rows)
    assert value(stub, "test1.mr1_se.missed").tolist() == [2, 0]
    assert value(stub, "test1.mr1_se.false").tolist() == [0, 3]
    assert value(stub, "test1.mr1_se.false", region_arcmin=4.0).tolist() == [0, 0]
    assert value(stub, "test1.mr1_se.false", false=("spurious",)).tolist() == [0, 1]
    assert value(stub, "test1.mr1_se.false", false=("spurious", "duplicate")).tolist() == [0, 2]


def pairs(stub: StubResults, method: str, separation: float, found: dict[int, list[int]]) -> None:
    """Two pairs in each of two images: sources 0 (100 counts), 1 (20), 2 (100), 5 (500); numbers with a gap."""
    counts = {0: 100.0, 1: 20.0, 2: 100.0, 5: 500.0}
    for image in (0, 1):
        stub.add(TEST_1, "truth", [
            {"realisation": image, "source_id": s, "kind": "point", "group_id": s // 2, "group_sep_arcsec": separation,
             "counts_onaxis": n} for s, n in counts.items()
        ])  # fmt: skip
        stub.add(TEST_1, "matches", [matched(image, s, counts[s], 0.6 * counts[s]) for s in found[image]], method)
    for row in stub.rows[(TEST_1, "truth", "MR/1+SE", SOFT_10)]:
        row["group_id"] = {0: 0, 1: 0, 2: 1, 5: 1}[row["source_id"]]


def test_a_pair_is_separated_when_both_members_are_found():
    stub = StubResults(2)
    pairs(stub, "EMLDETECT", 15.0, {0: [0, 1, 2], 1: [1, 2, 5]})
    assert value(stub, "test1.dr15.eml_only").tolist() == [1, 1]
    # the fainter of 100 and 500 is the one of 100
    assert value(stub, "test1.dr15.eml_only", reading="fainter member alone").tolist() == [2, 2]


def test_pairs_of_other_separations_do_not_count():
    stub = StubResults(2)
    pairs(stub, "VTPDETECT", 60.0, {0: [0, 1], 1: []})
    assert value(stub, "test1.vtp.merge30").tolist() == [0, 0]


def test_the_position_error_of_test_1_can_be_larger_than_the_search_radius():
    stub = StubResults(1)
    for method in ("EMLDETECT", "VTPDETECT", "WAVDETECT", "EWAVELET", "G+SE", "MR/1+SE"):
        distance = 12.0 if method == "VTPDETECT" else 2.0
        stub.add(TEST_1, "matches", [matched(0, 0, 100.0, 90.0, rule="origin", sep_arcsec=distance)], method)
    assert value(stub, "test1.pos_error").tolist() == [12.0]
    assert value(stub, "test1.pos_error", reading="without VTPDETECT").tolist() == [2.0]


def test_the_loss_is_one_minus_the_mean_ratio():
    stub = StubResults(2)
    pairs(stub, "EWAVELET", 30.0, {0: [0, 1], 1: [2]})
    assert value(stub, "test1.ewav.loss") == pytest.approx([0.4, 0.4])


def test_flux_scatter_is_about_unity_and_by_reading_about_the_mean():
    stub = StubResults(2)
    for method in ("EMLDETECT", "WAVDETECT", "EWAVELET", "G+SE", "MR/1+SE"):
        pairs(stub, method, 60.0, {0: [0, 2, 5], 1: [0]}) if method == "EMLDETECT" else stub.add(
            TEST_1, "matches", [matched(0, s, 100.0, 60.0) for s in (0, 2)], method
        )
    assert value(stub, "test1.dr60.flux_bright") == pytest.approx([0.4, np.nan], nan_ok=True)
    about_mean = value(stub, "test1.dr60.flux_bright", reading="scatter about the mean")
    assert about_mean == pytest.approx([0.0, np.nan], nan_ok=True, abs=1e-7)


def test_clusters_first_gives_the_only_detection_of_a_pair_to_its_cluster():
    stub = StubResults(1)
    stub.add(TEST_2, "truth", [
        {"realisation": 0, "source_id": 0, "kind": "point", "group_sep_arcsec": 15.0, "counts_onaxis": 100.0},
        {"realisation": 0, "source_id": 1, "kind": "extended", "group_sep_arcsec": 15.0, "counts_onaxis": 500.0},
    ])  # fmt: skip
    stub.add(TEST_2, "matches", [matched(0, 0, 100.0, 250.0), status(0, "missed", kind_true="extended", source_id=1)])
    stub.add(TEST_2, "links", [
        {"realisation": 0, "det_id": 0, "source_id": 0, "sep_arcsec": 4.0},
        {"realisation": 0, "det_id": 0, "source_id": 1, "sep_arcsec": 11.0},
    ])  # fmt: skip
    stub.add(TEST_2, "detections", [{"realisation": 0, "det_id": 0, "counts": 250.0, "rate_cps": 0.025}])
    for kind, nearest, clusters_first in (("point", 0, 1), ("ext", 1, 0)):
        assert value(stub, f"test2.mr1_se.missed_{kind}").tolist() == [nearest]
        again = value(stub, f"test2.mr1_se.missed_{kind}", reading="clusters first")
        assert again.tolist() == [clusters_first]


def bright_field() -> StubResults:
    stub = StubResults(2)
    rows = [matched(0, 0, 200.0, 90.0, sep_arcsec=3.0), matched(0, 1, 150.0, 150.0, sep_arcsec=4.0),
            matched(0, 2, 60.0, 60.0, sep_arcsec=5.0), matched(1, 0, 120.0, 130.0, sep_arcsec=2.0)]  # fmt: skip
    stub.add(TEST_3, "matches", rows)
    stub.add(TEST_3, "truth", [
        {"realisation": f, "source_id": s, "kind": "point", "x_pix": 10.0, "y_pix": 10.0}
        for f, s in ((0, 0), (0, 1), (0, 2), (1, 0))
    ])  # fmt: skip
    stub.add(TEST_3, "detections", [
        {"realisation": f, "det_id": s, "x_pix": 10.0, "y_pix": 10.0, "counts": 30.0, "r50_arcsec": r, "stellarity": p,
         "offaxis_arcmin": 5.0}
        for f, s, r, p in ((0, 0, 25.0, 0.05), (0, 1, 25.0, 0.5), (0, 2, 10.0, 0.05), (1, 0, 25.0, 0.05))
    ])  # fmt: skip
    return stub


@pytest.mark.parametrize(
    ("reading", "expected"),
    [
        ("", [np.sqrt(12.5), 2.0]),
        ("mean separation", [3.5, 2.0]),
        ("largest separation", [4.0, 2.0]),
        ("per axis", [2.5, np.sqrt(2.0)]),
        ("half a pixel off", [np.sqrt(8.0), np.sqrt(8.0)]),
        ("more than 100 measured counts", [4.0, 2.0]),
    ],
)
def test_the_position_error_has_named_readings(reading, expected):
    assert value(bright_field(), "test3.mr1_se.pos_error", reading=reading) == pytest.approx(expected)


def test_the_number_of_bright_matches_goes_by_input_counts_unless_read_otherwise():
    assert value(bright_field(), "test3.mr1_se.number").tolist() == [2, 1]
    measured = value(bright_field(), "test3.mr1_se.number", reading="more than 100 measured counts")
    assert measured.tolist() == [1, 1]
    assert value(bright_field(), "test3.mr1_se.number", input_counts="counts_expected").tolist() == [0, 0]


def clusters() -> StubResults:
    stub = StubResults(3)
    for image in range(3):
        stub.add(TEST_4, "truth", [
            {"realisation": image, "source_id": 7, "kind": "extended", "redshift": 0.6, "counts_onaxis": 1000.0,
             "counts_expected": 500.0}
        ])  # fmt: skip
    stub.add(TEST_4, "matches", [status(0, "missed")])
    stub.add(TEST_4, "links", [
        {"realisation": 0, "det_id": 0, "source_id": 7, "sep_arcsec": 12.0},
        {"realisation": 0, "det_id": 1, "source_id": 7, "sep_arcsec": 3.0},
        {"realisation": 1, "det_id": 0, "source_id": 7, "sep_arcsec": 25.0},
    ])  # fmt: skip
    stub.add(TEST_4, "detections", [
        {"realisation": 0, "det_id": 0, "counts": 600.0, "rate_cps": 0.09},
        {"realisation": 0, "det_id": 1, "counts": 200.0, "rate_cps": 0.03},
        {"realisation": 1, "det_id": 0, "counts": 700.0, "rate_cps": 0.1},
    ])  # fmt: skip
    return stub


def test_the_detection_nearest_to_the_cluster_stands_for_it():
    assert value(clusters(), "test4.mr1_se.z0.6.offset") == pytest.approx([3.0, np.nan, np.nan], nan_ok=True)
    assert value(clusters(), "test4.mr1_se.z0.6.ratio") == pytest.approx([0.2, np.nan, np.nan], nan_ok=True)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"reading": "brightest detection within 20″"}, 0.6),
        ({"reading": "counts of all detections within 20″"}, 0.8),
        ({"input_counts": "counts_expected"}, 0.4),
        ({"measured_counts": "counts_corrected"}, 0.3),
    ],
)
def test_cluster_counts_have_named_alternatives(change, expected):
    assert value(clusters(), "test4.mr1_se.z0.6.ratio", **change)[0] == pytest.approx(expected)


def test_a_cluster_beyond_20_arcsec_is_not_detected():
    stub = clusters()
    for row in stub.rows[(TEST_4, "truth", "MR/1+SE", SOFT_10)]:
        row["redshift"] = 1.8
    for table in ("matches", "links", "detections"):
        stub.rows[(TEST_4, table, "G+SE", SOFT_10)] = stub.rows[(TEST_4, table, "MR/1+SE", SOFT_10)]
    assert value(stub, "test4.gauss_se.z1.8.offset").tolist() == [1, 0, 0]


def ten(stub_rows, n=10, **where) -> StubResults:
    """The same rows in each of ten fields: every drawn group is ten times one field."""
    stub = StubResults(n)
    for (campaign, table, method, cell), rows in stub_rows.items():
        for f in range(n):
            stub.add(campaign, table, [row | {"realisation": f} for row in rows], method, cell)
    return stub


def test_wrong_classifications_are_those_of_ten_fields_of_points():
    one = [row for row in bright_field().rows[(TEST_3, "detections", "MR/1+SE", SOFT_10)] if row["realisation"] == 0]
    stub = ten({(TEST_3, "detections", "MR/1+SE", SOFT_10): one})
    assert set(value(stub, "test4.class.wrong")) == {10.0}
    assert set(value(stub, "test4.n_det")) == {30.0}
    assert value(stub, "test4.class.right") == pytest.approx(np.full(500, 2 / 3))
    assert set(value(stub, "test4.class.wrong", reading="r50 alone")) == {20.0}
    assert set(value(stub, "test4.class.wrong", reading="stellarity alone")) == {20.0}


def deep(flux_cgs, found, method="MR/1+SE", campaign=TEST_5):
    rows = [
        matched(0, i, f / ECF * 1e5, f / ECF * 1e5, flux_true_cgs=f, flux_cgs=f, status="matched" if k else "missed",
                det_id=i if k else -1)
        for i, (f, k) in enumerate(zip(flux_cgs, found, strict=True))
    ]  # fmt: skip
    truth = [{"source_id": i, "kind": "point", "flux_cgs": f, "offaxis_arcmin": 5.0} for i, f in enumerate(flux_cgs)]
    return {
        (campaign, "matches", method, SOFT_100): rows,
        (campaign, "truth", "MR/1+SE", SOFT_100): truth,
    }


def test_lost_sources_are_the_missed_ones_of_the_flux_range():
    stub = ten(deep([2.9e-16, 3.1e-16, 4e-16, 5e-16, 6.1e-16], [0, 0, 1, 1, 0]))
    assert value(stub, "test5.lost") == pytest.approx(np.full(500, 1 / 3))


def test_the_limit_of_all_brighter_inputs_lies_below_that_of_single_fluxes():
    fluxes = np.repeat([4.2e-16, 8.4e-16, 1.7e-15], 10)
    found = [1] * 5 + [0] * 5 + [1] * 9 + [0] + [1] * 10
    stub = ten(deep(fluxes, found))
    single, together = value(stub, "test5.limit90.soft.100ks"), None
    together = value(stub, "test5.limit90.soft.100ks", reading="all brighter inputs")
    assert single == pytest.approx(np.full(500, 8.4e-16), rel=1e-6)
    # 19 of the 20 brighter ones, but 24 of all 30: reached just above the faintest
    assert np.all((together > 4.2e-16) & (together < 5e-16))


def test_confusion_is_what_isolated_sources_of_the_same_flux_would_have_been_found():
    fluxes = [6e-16] * 10
    stub = ten(deep(fluxes, [1] * 7 + [0] * 3) | deep(fluxes, [1] * 9 + [0], campaign=GRID))
    assert value(stub, "test5.confusion.soft100") == pytest.approx(np.full(500, 0.2))


def test_counts_agree_down_to_where_they_fall_short():
    fluxes = np.repeat([4e-16, 8e-16, 1.6e-15], [40, 20, 20])
    stub = ten(deep(fluxes, [0] * 40 + [1] * 40))
    limit = value(stub, "test5.lognlogs.mr1_se.100ks")
    assert np.all((limit > 4e-16) & (limit <= 8e-16))


def test_moments_of_drawn_groups_are_those_of_their_fields():
    sums = Moments(np.array([1.0, 2.0]), np.array([2.0, 6.0]), np.array([4.0, 20.0]))
    drawn = sums.drawn(np.array([[1.0, 1.0]]))  # 2; 2, 4
    assert drawn.mean == pytest.approx(8 / 3)
    assert drawn.stdev == pytest.approx(np.std([2, 2, 4], ddof=1))
    assert drawn.about_unity == pytest.approx(np.sqrt((1 + 1 + 9) / 3))


def test_every_group_has_ten_fields_and_is_the_same_every_time():
    weights = group_weights(25)
    assert np.all(weights.sum(axis=1) == 10)
    assert np.array_equal(weights, group_weights(25))
    assert len(group_weights(3)) == 0


def test_the_spread_of_groups_holds_ten_fields_and_our_own_number():
    # a number of unit variance per field: 10 of the group's and 100 / n of ours, ± 5 σ of 500 groups
    values = np.random.default_rng(1).normal(size=40)
    values = (values - values.mean()) / values.std()
    variance = (group_weights(40) @ values).var()
    assert variance == pytest.approx(10 + 100 / 40, rel=5 * np.sqrt(2 / 500))


def test_the_constants_come_from_the_code_that_draws():
    by_claim = evidence_by_claim()
    assert by_claim["sim.psf_hew"].values()[0] == pytest.approx(15.0, rel=1e-9)
    assert by_claim["sim.counts_at_limit"].values()[0] == pytest.approx(89.55, abs=0.01)
    assert by_claim["tab2.z0.6.core_radius"].values()[0] == pytest.approx(32.85, abs=0.01)
