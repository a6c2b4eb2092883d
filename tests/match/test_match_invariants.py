"""What holds for every field, every catalogue and every rule."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from match_fields import N_PIX, field_of, fields_and_detections

from survey_mc.array_frame import ArrayFrame
from survey_mc.columns import LINKS, MATCHES
from survey_mc.match import STATUSES, MatchParams, match_field

COUNTS_MIN = 10.0
ASSIGNMENTS = ("nearest_from_detection", "mutual", "one_to_one")
quick = settings(max_examples=60, deadline=None)
cases = given(fields_and_detections(), st.sampled_from(ASSIGNMENTS), st.sampled_from((1.0, 1.7, 10.0)))


def params_of(assignment, region_arcmin):
    return MatchParams(assignment=assignment, region_arcmin=region_arcmin)


def pairs(matches):
    return set(zip(matches["rule"], matches["status"], matches["source_id"], matches["det_id"], strict=True))


@quick
@cases
def test_sources_and_detections_are_each_counted_once(case, assignment, region_arcmin):
    field, detections = case
    matches = match_field(field, detections, params_of(assignment, region_arcmin), COUNTS_MIN).matches
    in_scope = ((field.truth["counts_expected"] >= COUNTS_MIN) & (field.truth["offaxis_arcmin"] <= region_arcmin)).sum()
    for _, rows in matches.groupby("rule"):
        assert rows["status"].isin(["matched", "missed"]).sum() == in_scope
        assert (rows["status"] != "missed").sum() == len(detections)
        assert sorted(rows.loc[rows["det_id"] >= 0, "det_id"]) == list(detections["det_id"])
        assert not rows.loc[rows["status"].isin(["matched", "missed"]), "source_id"].duplicated().any()
    assert set(matches["status"]) <= set(STATUSES)


@quick
@cases
def test_order_of_rows_changes_nothing(case, assignment, region_arcmin):
    field, detections = case
    params = params_of(assignment, region_arcmin)
    shuffled = detections.sample(frac=1.0, random_state=1)
    one, two = (match_field(field, d, params, COUNTS_MIN) for d in (detections, shuffled))
    assert one.matches.equals(two.matches)
    assert one.links.equals(two.links)


@quick
@cases
def test_other_names_for_the_sources_give_the_same_pairs(case, assignment, region_arcmin):
    field, detections = case
    params = params_of(assignment, region_arcmin)
    n = len(field.truth)
    new_id = np.random.default_rng(7).permutation(n)
    truth = field.truth.assign(source_id=new_id.astype(np.int32)).sort_values("source_id", ignore_index=True)
    origin = np.where(field.origin >= 0, np.append(new_id, -1)[field.origin], -1).astype(np.int32)
    renamed = match_field(
        replace(field, truth_rows=ArrayFrame.of_frame(truth), origin=origin), detections, params, COUNTS_MIN
    ).matches
    old = match_field(field, detections, params, COUNTS_MIN).matches
    back = np.append(np.argsort(new_id), -1)
    assert pairs(old) == pairs(renamed.assign(source_id=back[renamed["source_id"]]))


@quick
@cases
def test_mirror_image_gives_the_same_pairs(case, assignment, region_arcmin):
    field, detections = case
    params = params_of(assignment, region_arcmin)
    photons = np.column_stack((field.observation.photons_pix, field.origin))
    photons[:, 0] = N_PIX - 1 - photons[:, 0]
    truth = field.truth.assign(x_pix=N_PIX - 1 - field.truth["x_pix"])
    mirrored = field_of(truth, photons, 0.1)
    flipped = detections.assign(x_pix=N_PIX - 1 - detections["x_pix"])
    assert pairs(match_field(field, detections, params, COUNTS_MIN).matches) == pairs(
        match_field(mirrored, flipped, params, COUNTS_MIN).matches
    )


def plain_shares(inside, around):
    """Photons of the main source, the one with the largest excess if that is above 2σ, and most of any other one."""
    counts = [(s, int((inside == s).sum()), int((around == s).sum())) for s in np.unique(inside[inside >= 0])]
    if not counts:
        return 0, 0
    main = max(counts, key=lambda c: (c[1] - c[2], c[1]))
    if main[1] - main[2] <= 2.0 * np.sqrt(main[1] + main[2]):
        main = max(counts, key=lambda c: c[1])
    return main[1], max((c[1] for c in counts if c is not main), default=0)


@quick
@cases
def test_photon_facts_equal_a_plain_count(case, assignment, region_arcmin):
    field, detections = case
    params = params_of(assignment, region_arcmin)
    matched = match_field(field, detections, params, COUNTS_MIN)
    rows = matched.matches[(matched.matches["rule"] == "origin") & (matched.matches["det_id"] >= 0)].set_index("det_id")
    x, y = field.observation.photons_pix.T
    scale = field.observation.grid.scale_arcsec
    for d in detections.itertuples():
        radius = min(max(15.0, d.r50_arcsec if d.r50_arcsec > 0 else 0.0), 120.0)
        distance = np.hypot(x - d.x_pix, y - d.y_pix) * scale
        inside = field.origin[distance <= radius]
        around = field.origin[(distance > radius) & (distance <= radius * np.sqrt(2.0))]
        row = rows.loc[d.det_id]
        assert (row["n_main"], row["n_second"], row["n_background"]) == (*plain_shares(inside, around), sum(inside < 0))
        linked = matched.links[matched.links["det_id"] == d.det_id]
        assert all((inside == link.source_id).sum() == link.n_photons for link in linked.itertuples())


@quick
@cases
def test_links_hold_every_close_pair(case, assignment, region_arcmin):
    field, detections = case
    links = match_field(field, detections, params_of(assignment, region_arcmin), COUNTS_MIN).links
    dx = np.subtract.outer(detections["x_pix"].to_numpy(), field.truth["x_pix"].to_numpy())
    dy = np.subtract.outer(detections["y_pix"].to_numpy(), field.truth["y_pix"].to_numpy())
    close = set(zip(*np.nonzero(np.hypot(dx, dy) * 4.0 <= 30.0), strict=True))
    assert {(d, s) for d, s, sep in zip(links["det_id"], links["source_id"], links["sep_arcsec"], strict=True)
            if sep <= 30.0} == close  # fmt: skip
    assert (links.loc[links["sep_arcsec"] > 30.0, "n_photons"] >= 3).all()


def test_frames_have_the_declared_columns(simple_field):
    field, detections = simple_field
    matched = match_field(field, detections, MatchParams(), COUNTS_MIN)
    for frame, table in ((matched.matches, MATCHES), (matched.links, LINKS)):
        assert tuple(frame.columns) == table.names[1:]
        for column in table.columns[1:]:
            if column.dtype != "string":
                assert frame[column.name].dtype == column.dtype, column.name


@pytest.mark.parametrize(("n_sources", "n_detections"), [(0, 0), (0, 2), (2, 0)])
def test_empty_lists_are_answers(n_sources, n_detections):
    from match_fields import detection_frame, truth_frame

    truth = truth_frame([20.0, 40.0][:n_sources], [30.0, 30.0][:n_sources], [50, 50][:n_sources])
    detections = detection_frame([20.0, 40.0][:n_detections], [30.0, 30.0][:n_detections])
    matched = match_field(field_of(truth, []), detections, MatchParams(), COUNTS_MIN)
    assert len(matched.matches) == 2 * (n_sources + n_detections)
    assert len(matched.links) == 0
    assert tuple(matched.matches.columns) == MATCHES.names[1:]
