"""What every registered instrument must be, and the published numbers of those beside EPIC."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from plain_expose import NO_SKY, sky_of
from pydantic import ValidationError

from survey_mc.campaign import parse_campaign
from survey_mc.detect import DETECTORS
from survey_mc.detect.contract import check_detections
from survey_mc.errors import BadInput
from survey_mc.rng import stream
from survey_mc.telescope import INSTRUMENTS, InstrumentSettings
from survey_mc.telescope.expose import expose
from survey_mc.telescope.instruments import Instrument, InstrumentBand
from survey_mc.telescope.psf import KingPsf
from survey_mc.telescope.response import build_response
from survey_mc.telescope.vignetting import VALID_ARCMIN, check_coefficients, vignetting
from survey_mc.types import Field, Sky
from survey_mc.units import rate_from_flux

Z_1E4 = 3.89  # two-sided 1e-4 false alarm of a normal variate
PAIRS = [
    pytest.param(instrument, band, id=f"{instrument.name}-{band.name}")
    for instrument in INSTRUMENTS
    for band in instrument.bands
]
EACH_INSTRUMENT = pytest.mark.parametrize("instrument", INSTRUMENTS, ids=lambda instrument: instrument.name)
EACH_BAND = pytest.mark.parametrize(("instrument", "band"), PAIRS)

TEXT = """
schema = 1
name = "other"
seed = 7

[instrument]
name = "NAME"

[sky]
kind = "lognlogs"
flux_min_cgs = 1e-15

[grid]
band = ["BAND"]
exposure_ks = [10.0]
realisations = 1

[[method]]
name = "gauss_se"

[match]
region_arcmin = 4.0
counts_min = 10
"""


def text_of(instrument: str, band: str) -> str:
    return TEXT.replace("NAME", instrument).replace("BAND", band)


def drawn(sky: Sky, settings: InstrumentSettings, band: str, exposure_s: float, key: str = "field") -> Field:
    return expose(sky, build_response(settings, band, exposure_s), partial(stream, key), key)


def radii_arcsec(field: Field, x_arcsec: float, y_arcsec: float) -> np.ndarray:
    grid = field.observation.grid
    xy_arcsec = (field.observation.photons_pix - np.array(grid.axis_pix)) * grid.scale_arcsec
    return np.hypot(xy_arcsec[:, 0] - x_arcsec, xy_arcsec[:, 1] - y_arcsec)


def hri_formula(radius_arcsec: np.ndarray) -> np.ndarray:
    """Surface brightness of the published on-axis PSF, not normalised."""
    r = np.asarray(radius_arcsec)
    core = 0.96 * np.exp(-0.5 * (r / 2.18) ** 2) + 0.18 * np.exp(-0.5 * (r / 4.04) ** 2)
    return core + 0.0009 * np.exp(-r / 31.7)


def hri_encircled(radius_arcsec: np.ndarray) -> np.ndarray:
    """Encircled fraction of the published formula, integrated in closed form."""
    r = np.asarray(radius_arcsec)
    core = sum(a * s**2 * -np.expm1(-0.5 * (r / s) ** 2) for a, s in ((0.96, 2.18), (0.18, 4.04)))
    halo = 0.0009 * 31.7**2 * (1.0 - np.exp(-r / 31.7) * (1.0 + r / 31.7))
    return (core + halo) / (0.96 * 2.18**2 + 0.18 * 4.04**2 + 0.0009 * 31.7**2)


@EACH_INSTRUMENT
def test_record_is_complete_and_fits_its_image(instrument: Instrument) -> None:
    assert instrument.name.isidentifier()
    assert all((instrument.label, instrument.about, instrument.reference))
    assert instrument.n_pix <= 1024
    assert 2.0 * instrument.field_of_view_arcmin * 60.0 <= instrument.n_pix * instrument.scale_arcsec
    assert instrument.field_of_view_arcmin <= VALID_ARCMIN
    assert len(set(instrument.band_names)) == len(instrument.bands) > 0
    assert set(instrument.band_names) <= {"soft", "hard"}


@EACH_BAND
def test_band_is_physical(instrument: Instrument, band: InstrumentBand) -> None:
    assert (band.energy_min_kev, band.energy_max_kev) == {"soft": (0.5, 2.0), "hard": (2.0, 10.0)}[band.name]
    check_coefficients(f"{instrument.name}.{band.name}", band.vignetting)
    angles = np.linspace(0.0, instrument.field_of_view_arcmin, 200)
    assert np.all(np.diff(vignetting(angles, band.vignetting)) < 0.0)
    # one photon of the middle of the band through 20 to 5000 cm²
    erg_per_kev = 1.602e-9
    middle_erg = math.sqrt(band.energy_min_kev * band.energy_max_kev) * erg_per_kev
    assert 20.0 < middle_erg / band.flux_per_rate_cgs < 5000.0
    background_per_arcmin2 = band.background_cps_per_pix * (60.0 / instrument.scale_arcsec) ** 2
    assert 5e-4 < background_per_arcmin2 < 1e-2


@EACH_BAND
def test_drawn_photons_are_conserved_and_accounted_for(instrument: Instrument, band: InstrumentBand) -> None:
    sky = sky_of((0.3, 0.4, 0.05), (100.0, -60.0, 0.02), (instrument.field_of_view_arcmin * 50.0, 0.0, 0.02))
    field = drawn(sky, InstrumentSettings(name=instrument.name), band.name, 2e4)
    assert field.observation.counts.sum() == len(field.origin) == len(field.observation.photons_pix)
    of_source = np.bincount(field.origin[field.origin >= 0], minlength=3)
    assert np.array_equal(of_source, field.truth["counts_drawn"])
    assert field.observation.counts[field.observation.exposure_s == 0.0].sum() == 0
    # nearly all photons of the PSF fall on the image; at most 5 % of EPIC's lie beyond 2′
    expected = field.truth["counts_expected"].to_numpy()
    assert np.all(field.truth["counts_drawn"] < expected + Z_1E4 * np.sqrt(expected))
    assert np.all(field.truth["counts_drawn"] > 0.93 * expected - Z_1E4 * np.sqrt(expected))


@EACH_BAND
def test_background_of_the_sky_is_the_published_level(instrument: Instrument, band: InstrumentBand) -> None:
    level = {
        "xmm_epic-soft": 4.005e-3,
        "xmm_epic-hard": 5.4e-3,
        "rosat_hri-soft": 3.8e-3,
        "chandra_acis-soft": 0.07 / 8.3**2,  # ct/s of a chip of 8.3′
        "chandra_acis-hard": 0.16 / 8.3**2,
    }[f"{instrument.name}-{band.name}"]
    flat = InstrumentSettings(name=instrument.name, vignetting=False, field_of_view=False)
    response = build_response(flat, band.name, 5e4)
    area_arcmin2 = (instrument.n_pix * instrument.scale_arcsec / 60.0) ** 2
    assert response.background_expected.sum() / 5e4 / area_arcmin2 == pytest.approx(level, rel=0.015)
    n_photons = drawn(NO_SKY, flat, band.name, 5e4).observation.counts.sum()
    expected = response.background_expected.sum()
    # odds 1e-4
    assert abs(n_photons - expected) < Z_1E4 * math.sqrt(expected)


@EACH_INSTRUMENT
def test_photons_encircle_what_the_formula_says(instrument: Instrument) -> None:
    only_psf = InstrumentSettings(name=instrument.name, vignetting=False, background=False, field_of_view=False)
    at = 0.37 * instrument.scale_arcsec
    field = drawn(sky_of((at, -at, 10.0)), only_psf, "soft", 1e4)
    psf = KingPsf.from_fwhm_hew(instrument.psf_fwhm_arcsec, instrument.psf_hew_arcsec)
    assert field.observation.psf == psf
    radii = radii_arcsec(field, at, -at)
    edges = psf.radius_of_fraction(np.linspace(0.0, 0.95, 20))
    found = np.histogram(radii, edges)[0]
    expected = 1e5 / 20.0
    chi2 = ((found - expected) ** 2 / expected).sum()
    # 19 cells, odds 1e-4: a normal variate of mean 19 and variance 38, with room for its skewness
    assert 19.0 - Z_1E4 * math.sqrt(38.0) < chi2 < 19.0 + 1.4 * Z_1E4 * math.sqrt(38.0)


@EACH_INSTRUMENT
def test_every_procedure_finds_one_bright_source_in_its_image(instrument: Instrument) -> None:
    settings = InstrumentSettings(name=instrument.name, n_pix=128, field_of_view=False)
    at = 6.3 * instrument.scale_arcsec
    field = drawn(sky_of((at, -at, 0.03)), settings, "soft", 2e4)
    for detector in DETECTORS:
        found = detector.detect(field.observation, detector.profiles["paper"], np.random.default_rng(1))
        check_detections(detector, field.observation, found)
        grid = field.observation.grid
        sep_pix = np.hypot(found["x_pix"] - grid.pix_from_arcsec(at, 0), found["y_pix"] - grid.pix_from_arcsec(-at, 1))
        assert sep_pix.min() < 1.5, detector.name


def test_hri_widths_are_those_of_the_published_formula() -> None:
    hri = INSTRUMENTS["rosat_hri"]
    half = hri_formula(np.array([0.0, hri.psf_fwhm_arcsec / 2.0]))
    assert half[1] / half[0] == pytest.approx(0.5, abs=1e-4)
    assert hri_encircled(hri.psf_hew_arcsec / 2.0) == pytest.approx(0.5, abs=1e-4)


def test_hri_king_profile_lacks_the_halo_of_the_formula() -> None:
    radius = np.geomspace(0.01, 1000.0, 4000)
    hri = INSTRUMENTS["rosat_hri"]
    king = KingPsf.from_fwhm_hew(hri.psf_fwhm_arcsec, hri.psf_hew_arcsec).encircled_energy(radius)
    excess = king - hri_encircled(radius)
    assert excess.max() == pytest.approx(0.089, abs=1e-3)
    assert radius[excess.argmax()] == pytest.approx(18.7, abs=0.2)
    assert excess.min() > -0.003
    inside = radius < hri.psf_hew_arcsec / 2.0
    assert np.abs(excess[inside]).max() < 0.003


def test_hri_conversion_is_the_handbooks_for_the_0p5_to_2_kev_part_of_the_flux() -> None:
    rate_in_half_cell = 0.141  # of 1e-11 erg/cm²/s in 0.1-2.4 keV, photon index 2, N_H = 10^19.7
    part = math.log(2.0 / 0.5) / math.log(2.4 / 0.1)
    (soft,) = INSTRUMENTS["rosat_hri"].bands
    assert soft.flux_per_rate_cgs == pytest.approx(1e-11 * part / (2.0 * rate_in_half_cell), rel=1e-3)


def test_hri_vignetting_is_below_a_tenth_inside_10_arcmin() -> None:
    (soft,) = INSTRUMENTS["rosat_hri"].bands
    assert 0.9 < vignetting(np.array([10.0]), soft.vignetting)[0] < 1.0


def test_chandra_reaches_what_130_ks_reached() -> None:
    # Giacconi et al. 2001: 7 net counts in 130 ks at 2e-16 (soft) and 2e-15 (hard), printed with one figure
    for band, flux_cgs in zip(INSTRUMENTS["chandra_acis"].bands, (2e-16, 2e-15), strict=True):
        assert rate_from_flux(flux_cgs, band.flux_per_rate_cgs) * 130e3 == pytest.approx(7.0, rel=0.3)


def test_a_band_the_instrument_lacks_is_refused_with_a_sentence() -> None:
    hri = InstrumentSettings(name="rosat_hri")
    with pytest.raises(BadInput, match="rosat_hri has no band 'hard'; known: soft"):
        build_response(hri, "hard", 1e4)
    with pytest.raises(BadInput, match=r"other.toml: grid.band: rosat_hri has no band 'hard'; known: soft"):
        parse_campaign(text_of("rosat_hri", "hard"), "other.toml")
    with pytest.raises(ValidationError, match="flux_per_rate_cgs: rosat_hri has no band 'hard'; known: soft"):
        InstrumentSettings(name="rosat_hri", flux_per_rate_cgs={"hard": 1e-11})


@EACH_BAND
def test_a_campaign_of_the_instrument_is_accepted(instrument: Instrument, band: InstrumentBand) -> None:
    campaign = parse_campaign(text_of(instrument.name, band.name), "other.toml")
    assert campaign.instrument.name == instrument.name
