import numpy as np
import pytest
from match_fields import detection_frame, field_of, truth_frame

from survey_mc.match import MatchParams, chance_matches, chance_probability, completeness_without_chance
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
