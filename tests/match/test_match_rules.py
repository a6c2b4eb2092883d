"""What each rule decides, case by case (pixels of 4″; limit 10 counts; radius 6″ = 1.5 pixels)."""

import numpy as np
import pytest
from match_fields import detection_frame, field_of, photons_of, truth_frame

from survey_mc.match import MatchParams, match_field


def outcome(truth, detections, rule, params=None, photons=None, counts_min=10.0):
    photons = photons_of(truth, np.random.default_rng(5)) if photons is None else photons
    matches = match_field(field_of(truth, photons, 0.01), detections, params or MatchParams(), counts_min).matches
    rows = matches[matches["rule"] == rule]
    return [(r.status, r.det_id, r.source_id) for r in rows.itertuples()]


def test_detection_on_its_source_is_matched_by_both_rules():
    truth, detections = truth_frame([30.0], [30.0], [50]), detection_frame([30.2], [30.0])
    for rule in ("nearest", "origin"):
        assert outcome(truth, detections, rule) == [("matched", 0, 0)]


def test_of_two_detections_on_one_source_the_closer_is_matched_and_the_other_is_a_duplicate():
    truth, detections = truth_frame([30.0], [30.0], [200]), detection_frame([30.9, 30.3], [30.0, 30.0])
    assert outcome(truth, detections, "nearest") == [("duplicate", 0, 0), ("matched", 1, 0)]


def test_by_origin_the_detection_with_most_photons_is_matched():
    truth, detections = truth_frame([30.0], [30.0], [200]), detection_frame([33.5, 31.0], [30.0, 30.0])
    assert outcome(truth, detections, "origin") == [("duplicate", 0, 0), ("matched", 1, 0)]


def test_separation_at_the_radius_still_matches_and_beyond_it_does_not():
    truth = truth_frame([30.0], [30.0], [50])
    assert outcome(truth, detection_frame([31.5], [30.0]), "nearest")[0][0] == "matched"
    assert outcome(truth, detection_frame([31.501], [30.0]), "nearest") == [("spurious", 0, -1), ("missed", -1, 0)]


def test_by_origin_a_shifted_centroid_still_matches():
    truth = truth_frame([30.0], [30.0], [50])
    assert outcome(truth, detection_frame([32.5], [30.0]), "origin") == [("matched", 0, 0)]


def test_source_below_the_limit_makes_a_faint_detection():
    truth, detections = truth_frame([30.0], [30.0], [9]), detection_frame([30.0], [30.0])
    for rule in ("nearest", "origin"):
        assert outcome(truth, detections, rule) == [("faint", 0, 0)]


def test_two_sources_below_the_limit_make_a_blend():
    truth, detections = truth_frame([29.0, 31.0], [30.0, 30.0], [9, 8]), detection_frame([30.0], [30.0])
    for rule in ("nearest", "origin"):
        assert outcome(truth, detections, rule) == [("blend", 0, 0)]


def test_centroid_between_two_listed_sources_is_a_blend_by_position_and_a_match_by_origin():
    truth, detections = truth_frame([28.4, 31.6], [30.0, 30.0], [60, 40]), detection_frame([30.0], [30.0])
    assert outcome(truth, detections, "nearest") == [("blend", 0, 0), ("missed", -1, 0), ("missed", -1, 1)]
    assert outcome(truth, detections, "origin") == [("matched", 0, 0), ("missed", -1, 1)]


def test_background_alone_is_spurious():
    truth = truth_frame([], [], [])
    photons = [(30.0 + 0.1 * i, 30.0, -1) for i in range(8)]
    for rule in ("nearest", "origin"):
        assert outcome(truth, detection_frame([30.0], [30.0]), rule, photons=photons) == [("spurious", 0, -1)]


def test_photons_that_the_background_explains_have_no_origin():
    truth = truth_frame([30.0], [30.0], [50])
    photons = [(30.0, 30.0, 0)] * 4
    field_dark = field_of(truth, photons, background_per_pix=0.001)
    field_bright = field_of(truth, photons, background_per_pix=1.0)
    detections = detection_frame([32.0], [30.0])
    status = [
        match_field(f, detections, MatchParams(), 10.0).matches.query("rule == 'origin'")["status"].iloc[0]
        for f in (field_dark, field_bright)
    ]
    assert status == ["matched", "spurious"]


def test_nearer_unlisted_source_does_not_take_a_detection():
    truth, detections = truth_frame([30.0, 31.0], [30.0, 30.0], [5, 50]), detection_frame([30.2], [30.0])
    assert outcome(truth, detections, "nearest") == [("matched", 0, 1)]


def test_scope_of_a_pair_goes_by_the_source_and_of_the_rest_by_the_detection():
    params = MatchParams(region_arcmin=1.0)  # 15 pixels from (31.5, 31.5)
    truth = truth_frame([46.2, 17.0, 46.2], [31.5, 31.5, 40.0], [90, 90, 90])
    detections = detection_frame([46.8, 16.4, 31.5, 60.0], [31.5, 31.5, 31.5, 60.0])
    assert outcome(truth, detections, "nearest", params) == [
        ("matched", 0, 0),
        ("matched", 1, 1),
        ("spurious", 2, -1),
        ("outside", 3, -1),
    ]


def test_detection_inside_of_a_source_outside_is_outside():
    params = MatchParams(region_arcmin=1.0)
    truth, detections = truth_frame([46.8], [31.5], [90]), detection_frame([46.2], [31.5])
    assert outcome(truth, detections, "nearest", params) == [("outside", 0, 0)]


# sources at 30 and 31.2; detections at 30.7 (0.5 from the second source) and 31.9 (0.7 from it)
CHAIN = truth_frame([30.0, 31.2], [30.0, 30.0], [60, 60]), detection_frame([30.7, 31.9], [30.0, 30.0])


@pytest.mark.parametrize(
    ("assignment", "expected"),
    [
        ("nearest_from_detection", [("matched", 0, 1), ("duplicate", 1, 1), ("missed", -1, 0)]),
        ("mutual", [("matched", 0, 1), ("duplicate", 1, 1), ("missed", -1, 0)]),
        ("one_to_one", [("matched", 0, 0), ("matched", 1, 1)]),
    ],
)
def test_assignments_differ_where_sources_are_close(assignment, expected):
    assert outcome(*CHAIN, "nearest", MatchParams(assignment=assignment)) == expected


def test_mutual_refuses_a_source_whose_nearest_detection_went_elsewhere():
    truth = truth_frame([30.0, 30.6], [30.0, 30.0], [60, 60])
    detections = detection_frame([30.5, 29.3], [30.0, 30.0])  # source 0: 0.5 and 0.7 away; detection 0 prefers source 1
    paper = outcome(truth, detections, "nearest")
    mutual = outcome(truth, detections, "nearest", MatchParams(assignment="mutual"))
    assert paper == [("matched", 0, 1), ("matched", 1, 0)]
    assert mutual == [("matched", 0, 1), ("duplicate", 1, 0), ("missed", -1, 0)]


def test_equal_separations_go_to_the_lower_id():
    truth, detections = truth_frame([30.0, 31.0], [30.0, 30.0], [60, 60]), detection_frame([30.5], [30.0])
    assert outcome(truth, detections, "nearest")[0] == ("matched", 0, 0)


def test_photons_of_a_folded_image_make_a_faint_detection_and_no_list_entry():
    truth = truth_frame([np.nan], [np.nan], [500], kind="image")
    photons = [(30.0, 30.0, 0)] * 30
    for rule in ("nearest", "origin"):
        assert outcome(truth, detection_frame([30.0], [30.0]), rule, photons=photons) == [("faint", 0, 0)]


def test_large_object_counts_photons_out_to_its_r50_and_no_further_than_the_cap():
    truth = truth_frame([30.0], [30.0], [50])
    photons = [(30.0 + r, 30.0, 0) for r in (1.0, 6.0, 12.0, 29.0)]  # 4″, 24″, 48″, 116″
    counted = []
    for r50 in (np.nan, 30.0, 60.0, 1000.0):
        detections = detection_frame([30.0], [30.0], r50)
        params = MatchParams(aperture_max_arcsec=100.0)
        counted.append(match_field(field_of(truth, photons), detections, params, 10.0).matches["n_main"].iloc[0])
    assert counted == [1, 2, 3, 3]


def test_aperture_over_the_image_edge_counts_what_is_there():
    truth = truth_frame([0.0], [0.0], [50])
    photons = [(-0.4, -0.4, 0), (63.4, 0.0, 0), (0.0, 1.0, 0)]
    matches = match_field(field_of(truth, photons), detection_frame([-0.5], [-0.5]), MatchParams(), 10.0).matches
    assert matches["n_main"].iloc[0] == 2


def test_field_without_photon_list_counts_at_pixel_centres():
    from dataclasses import replace

    truth = truth_frame([30.0], [30.0], [50])
    field = field_of(truth, [(30.4, 30.0, 0), (33.6, 30.0, 0), (34.4, 30.0, 0)])
    binned = replace(field, observation=replace(field.observation, photons_pix=None))
    matches = match_field(binned, detection_frame([30.0], [30.0]), MatchParams(), 10.0).matches
    assert matches["n_main"].iloc[0] == 1  # the pixel centre at 34 is 16″ away


def test_limit_applies_to_the_chosen_counts():
    truth = truth_frame([30.0], [30.0], [50]).assign(counts_expected=8.0, counts_onaxis=12.0)
    detections = detection_frame([30.0], [30.0])
    by_expected = outcome(truth, detections, "nearest")
    by_onaxis = outcome(truth, detections, "nearest", MatchParams(counts_min_on="counts_onaxis"))
    assert (by_expected[0][0], by_onaxis[0][0]) == ("faint", "matched")


def disc(source_id, radius_pix, n_photons, x_pix=31.5, y_pix=31.5):
    """Photons spread evenly over a disc: what a cluster looks like from inside."""
    r, angle = radius_pix * np.sqrt((np.arange(n_photons) + 0.5) / n_photons), 2.399963 * np.arange(n_photons)
    return [(x_pix + a * np.cos(b), y_pix + a * np.sin(b), source_id) for a, b in zip(r, angle, strict=True)]


def test_source_seen_through_a_cluster_is_matched_and_not_a_second_detection_of_the_cluster():
    truth = truth_frame([31.5, 41.5], [31.5, 31.5], [4000, 30], kind=["extended", "point"])
    photons = disc(0, 25.0, 4000) + disc(1, 1.0, 30, 41.5)
    detections = detection_frame([31.5, 41.5], [31.5, 31.5], [100.0, 10.0])
    matches = match_field(field_of(truth, photons), detections, MatchParams(), 10.0).matches.query("rule == 'origin'")
    assert list(zip(matches["status"], matches["source_id"], strict=True)) == [("matched", 0), ("matched", 1)]
    assert matches["n_main"].iloc[1] == 30
    assert matches["n_second"].iloc[1] > 30  # the cluster still shines through


def test_fragment_of_a_cluster_is_a_duplicate_by_origin():
    truth = truth_frame([31.5], [31.5], [4000], kind="extended")
    detections = detection_frame([31.5, 41.5], [31.5, 31.5], [100.0, 10.0])
    assert outcome(truth, detections, "origin", photons=disc(0, 25.0, 4000)) == [("matched", 0, 0), ("duplicate", 1, 0)]


def test_fragment_beside_a_few_photons_of_another_source_stays_with_the_cluster():
    truth = truth_frame([31.5, 42.0], [31.5, 31.5], [4000, 3], kind=["extended", "point"])
    photons = disc(0, 25.0, 4000) + [(42.0, 31.5, 1)] * 3
    detections = detection_frame([31.5, 41.5], [31.5, 31.5], [100.0, 10.0])
    assert outcome(truth, detections, "origin", photons=photons)[1] == ("duplicate", 1, 0)


def test_source_in_the_wing_of_a_brighter_one_keeps_its_detection():
    truth = truth_frame([31.5, 40.0], [31.5, 31.5], [5000, 40])
    photons = [(31.5 + r * np.cos(a), 31.5 + r * np.sin(a), 0) for r, a in zip(np.geomspace(0.3, 30, 3000),
               2.399963 * np.arange(3000), strict=True)] + disc(1, 1.0, 40, 40.0)  # fmt: skip
    assert outcome(truth, detection_frame([40.0], [31.5]), "origin", photons=photons)[0] == ("matched", 0, 1)


def test_defaults_are_the_papers_and_the_documented_ones():
    params = MatchParams()
    assert (params.rule, params.radius_arcsec, params.region_arcmin, params.counts_min) == ("nearest", 6.0, 10.0, 10.0)
    assert (params.origin_radius_arcsec, params.aperture_max_arcsec) == (15.0, 120.0)
    assert (params.origin_counts_min, params.origin_chance_max, params.blend_fraction) == (3, 0.02, 1 / 3)
