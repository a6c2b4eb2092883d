"""Fig. 1: what the three telescopes make of the same line of sources."""

from __future__ import annotations

import math

import numpy as np
import pytest

from survey_mc.paper.figures.instruments import (
    CHANCE_OF_4_SIGMA,
    PAIR_SEPARATIONS_ARCSEC,
    SHOWN,
    STEP_ARCSEC,
    Profile,
    fold,
    has_own_maximum,
    instruments_figure,
    limit_counts,
    line_of_sources,
    line_spread,
)
from survey_mc.telescope import INSTRUMENTS
from survey_mc.telescope.psf import KingPsf

SKY = line_of_sources()


@pytest.fixture(scope="module")
def profiles() -> dict[str, Profile]:
    return {name: fold(SKY, INSTRUMENTS[name]) for name in SHOWN}


def test_sky_is_the_same_every_time_and_holds_the_pairs() -> None:
    again = line_of_sources()
    assert np.array_equal(SKY.x_arcsec, again.x_arcsec)
    assert np.array_equal(SKY.flux_cgs, again.flux_cgs)
    assert np.all(np.diff(SKY.x_arcsec) > 0.0)
    assert sorted(gap for _, gap in SKY.slots if gap) == sorted(PAIR_SEPARATIONS_ARCSEC)
    assert 0.0 < SKY.x_arcsec.min() < SKY.x_arcsec.max() < SKY.length_arcsec == 240.0


def test_limit_is_four_sigma_where_there_is_much_background() -> None:
    assert limit_counts(1e4) == pytest.approx(2.0 * 4.0 * 100.0, rel=0.02)


def test_limit_without_background_is_one_photon_in_the_half_energy_circle() -> None:
    assert limit_counts(0.0) == 2.0
    # one photon is commoner than 4 σ already at a background of 0.001
    assert -math.expm1(-1e-3) > CHANCE_OF_4_SIGMA
    assert limit_counts(1e-3) == pytest.approx(2.0 * (2.0 - 1e-3))


@pytest.mark.parametrize("name", SHOWN)
def test_strip_holds_the_photons_of_its_width(name: str) -> None:
    instrument = INSTRUMENTS[name]
    psf = KingPsf.from_fwhm_hew(instrument.psf_fwhm_arcsec, instrument.psf_hew_arcsec)
    x_arcsec = psf.hew_arcsec * np.linspace(-0.5, 0.5, 2001)
    in_square = np.trapezoid(line_spread(psf, x_arcsec), x_arcsec)
    # between the circles inside and around the square
    inner, outer = psf.encircled_energy(np.array([0.5, math.sqrt(0.5)]) * psf.hew_arcsec)
    assert inner < in_square < outer


def test_profile_is_the_background_far_from_every_source(profiles: dict[str, Profile]) -> None:
    chandra = profiles["chandra_acis"]
    band = chandra.instrument.bands[0]
    floor = band.background_cps_per_pix * 5e4 * chandra.instrument.psf_hew_arcsec
    assert chandra.counts_per_arcsec.min() == pytest.approx(floor, rel=0.05)


def test_limit_of_a_lone_source_is_its_peak_above_the_background(profiles: dict[str, Profile]) -> None:
    for profile in profiles.values():
        brightest = int(SKY.flux_cgs.argmax())
        at = round(SKY.x_arcsec[brightest] / STEP_ARCSEC)
        floor = profile.counts_per_arcsec.min()
        ratio = (profile.counts_per_arcsec[at] - floor) / (profile.limit_level - floor)
        # the wings of its neighbours add a little
        assert ratio == pytest.approx(SKY.flux_cgs[brightest] / profile.limit_flux_cgs, rel=0.1)


def test_xmm_sees_more_than_rosat_and_merges_what_chandra_splits(profiles: dict[str, Profile]) -> None:
    seen = {name: sum(state < 2 for state in profile.state) for name, profile in profiles.items()}
    merged = {name: profile.state.count(1) for name, profile in profiles.items()}
    assert seen["xmm_epic"] > 2 * seen["rosat_hri"] > 0
    assert merged["xmm_epic"] > merged["chandra_acis"] == 0


def test_a_shoulder_is_no_maximum() -> None:
    x_arcsec = np.arange(0.0, 60.0, STEP_ARCSEC)
    profile = np.exp(-0.5 * ((x_arcsec - 20.0) / 3.0) ** 2) + 0.2 * np.exp(-0.5 * ((x_arcsec - 25.0) / 3.0) ** 2)
    profile += 0.5 * np.exp(-0.5 * ((x_arcsec - 45.0) / 3.0) ** 2)
    assert has_own_maximum(profile, np.array([20.0, 25.0, 45.0]), 3.0).tolist() == [True, False, True]


def test_figure_has_three_panels_and_a_caption_with_its_numbers() -> None:
    drawn = instruments_figure()
    assert drawn.name == "instruments"
    assert len(drawn.figure.axes) == 3
    for name in SHOWN:
        assert INSTRUMENTS[name].label in drawn.caption
    assert "4σ" in drawn.caption
    assert "50 ks" in drawn.caption
