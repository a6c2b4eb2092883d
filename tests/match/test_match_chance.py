import numpy as np
import pytest
from match_fields import detection_frame, field_of, truth_frame

from survey_mc.match import MatchParams, chance_matches, chance_probability, completeness_without_chance
from survey_mc.match.chance import count_claims, rotated_claims
from survey_mc.types import PixelGrid

ARCSEC2_PER_DEG2 = 3600.0**2


@pytest.mark.parametrize(
    ("density_per_deg2", "radius_arcsec", "expected"),
    [(1641.0, 6.0, 0.014), (1641.0, 20.0, 0.147), (15000.0, 6.0, 0.12), (15000.0, 20.0, 0.77)],
)
def test_closed_form_gives_the_known_rates(density_per_deg2, radius_arcsec, expected):
    assert chance_probability(density_per_deg2, radius_arcsec) == pytest.approx(expected, rel=0.04)


def test_rotated_catalogue_agrees_with_the_closed_form():
    rng = np.random.default_rng(11)
    n_pix, n_sources, n_detections = 256, 1500, 600
    grid = PixelGrid.centred(n_pix, 4.0)
    truth = truth_frame(*rng.uniform(0, n_pix - 1, (2, n_sources)), np.full(n_sources, 50.0), grid=grid)
    detections = detection_frame(*rng.uniform(0, n_pix - 1, (2, n_detections)), grid=grid)
    params = MatchParams(region_arcmin=8.0)
    found = chance_matches(field_of(truth, [], n_pix=n_pix), detections, params, 10.0, n_rotations=20)
    density = n_sources / (((n_pix - 1) * 4.0) ** 2 / ARCSEC2_PER_DEG2)
    expected = chance_probability(density, 6.0)
    # sources are fixed while detections turn: 4 σ of the ~1500 independent sources' cover, relative 4/√(n·p) ≈ 11 %
    assert found.n_found / found.n_tried == pytest.approx(expected, rel=0.11)


def test_correction_undoes_chance():
    true, chance = np.array([0.0, 0.5, 0.9]), 0.2
    assert completeness_without_chance(true + (1 - true) * chance, chance) == pytest.approx(true)


def test_nothing_listed_matches_by_chance_never():
    truth = truth_frame([30.0], [30.0], [5])
    found = chance_matches(field_of(truth, []), detection_frame([30.0], [30.0]), MatchParams(), 10.0)
    assert (found.n_found, found.n_tried) == (0, 8)


def test_claims_of_sources_agree_with_the_closed_form_of_the_detections_density():
    rng = np.random.default_rng(12)
    radius_arcsec, half_arcsec = 20.0, 1200.0
    # sparse sources: a detection is never nearer to another one, so each neighbour is a claim
    sources, detections = (rng.uniform(-half_arcsec, half_arcsec, (n, 2)) for n in (150, 900))
    claims = rotated_claims(detections, sources, radius_arcsec, 20)
    source_inside = np.hypot(*sources.T) < 0.8 * half_arcsec
    found = count_claims(claims, np.ones(900, bool), np.hypot(*detections.T) < 0.8 * half_arcsec, source_inside)
    density = 900 / (2 * half_arcsec) ** 2 * ARCSEC2_PER_DEG2
    # about 75 sources, each seen by 20 turns of rings of the same detections: 20 % is 4 σ of 900 p independent ones
    assert found.n_sources == 20 * source_inside.sum()
    assert found.n_claimed / found.n_sources == pytest.approx(chance_probability(density, radius_arcsec), rel=0.2)


def disc(rng, n, radius_arcsec):
    radius, angle = radius_arcsec * np.sqrt(rng.random(n)), 2.0 * np.pi * rng.random(n)
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle)))


def test_unmatched_detections_turned_give_back_the_true_completeness():
    rng = np.random.default_rng(13)
    true, radius_arcsec, n_trials = 0.6, 20.0, 40
    measured, corrected = [], []
    for _ in range(n_trials):
        sources, false = disc(rng, 250, 1000.0), disc(rng, 250, 1000.0)
        found = rng.random(250) < true
        detections = np.concatenate((sources[found], false))
        separation = np.hypot(*(false[:, None] - sources[None]).T)  # sources by detections
        nearest = separation.argmin(axis=0)
        is_claim = separation.min(axis=0) <= radius_arcsec
        is_matched = found.copy()
        is_matched[nearest[is_claim]] = True
        has_source = np.concatenate((np.ones(found.sum(), bool), is_claim & ~found[nearest]))
        everywhere = np.ones(len(detections), bool)
        claims = rotated_claims(detections, sources, radius_arcsec)
        chance = count_claims(claims, ~has_source, everywhere, np.ones(250, bool))
        measured.append(is_matched.mean())
        corrected.append(completeness_without_chance(is_matched.mean(), chance.n_claimed / chance.n_sources))
    # binomial of 10 000 sources: σ = 0.005; 3.9 σ
    assert np.mean(measured) > true + 0.019
    assert np.mean(corrected) == pytest.approx(true, abs=0.019)


def test_source_on_the_radius_is_claimed_and_one_beyond_is_not():
    turned_back = 2.0 * np.pi * np.arange(1, 4) / 4
    sources = 100.0 * np.column_stack((np.cos(turned_back), np.sin(turned_back)))
    sources[2] *= 1.0601
    sources[1] *= 1.05999
    claims = rotated_claims(np.array([[100.0, 0.0]]), sources, 6.0, 3)
    assert claims.ravel().tolist() == [0, 1, -1]
