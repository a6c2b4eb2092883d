"""Exposure maps, background maps and predicted skies."""

import numpy as np
import pytest
from astropy.io import fits
from fits_samples import SCALE_ARCSEC, SHAPE, sample_counts, sky_header, write_image

from survey_mc.errors import BadInput
from survey_mc.fits import read_background_map, read_counts_image, read_exposure_map, read_sky_image

PIXEL_ARCMIN2 = (SCALE_ARCSEC / 60.0) ** 2


@pytest.fixture
def grid(tmp_path):
    return read_counts_image(write_image(tmp_path / "counts.fits")).grid


def map_file(tmp_path, values, **cards):
    return write_image(tmp_path / "map.fits", values, sky_header(np.shape(values), **cards))


def spoilt(value, rest=100.0):
    values = np.full(SHAPE, rest)
    values[2, 3] = value
    return values


@pytest.mark.parametrize(
    ("cards", "factor"), [({}, 1.0), ({"BUNIT": "s"}, 1.0), ({"BUNIT": "sec"}, 1.0), ({"BUNIT": "ks"}, 1e3)]
)
def test_exposure_is_in_seconds_whatever_the_unit(tmp_path, grid, cards, factor):
    exposure_s = read_exposure_map(map_file(tmp_path, np.full(SHAPE, 7.0, dtype=np.float32), **cards), SHAPE, grid.wcs)
    assert exposure_s.dtype == np.float64
    np.testing.assert_allclose(exposure_s, 7.0 * factor)


def test_nan_exposure_is_not_observed(tmp_path, grid):
    assert read_exposure_map(map_file(tmp_path, spoilt(np.nan)), SHAPE, grid.wcs)[2, 3] == 0.0


@pytest.mark.parametrize(
    ("values", "cards", "words"),
    [
        (spoilt(-1.0), {}, "exposure must not be negative"),
        (spoilt(np.inf), {}, "exposure must be finite"),
        (np.zeros(SHAPE), {}, "0 everywhere"),
        (np.full(SHAPE, np.nan), {}, "0 everywhere"),
        (np.ones((24, 31)), {}, "must have the 32 × 24 pixels of its image (got 31 × 24)"),
        (np.ones(SHAPE), {"BUNIT": "cm**2 s"}, "unit must be one of s, ks"),
        (np.ones(SHAPE), {"BUNIT": "counts cm2/photon"}, "unit must be one of"),
        (np.ones(SHAPE), {"BUNIT": "???"}, "unit must be one of"),
        (np.ones(SHAPE), {"CRPIX1": 17.2}, "must agree with that of its image within 0.5 pixel"),
        (np.ones(SHAPE), {"CRVAL1": 330.1, "CRVAL2": -2.2}, "must agree"),
    ],
)
def test_unusable_exposure_map_is_refused(tmp_path, grid, values, cards, words):
    with pytest.raises(BadInput, match=r"map\.fits") as caught:
        read_exposure_map(map_file(tmp_path, values, **cards), SHAPE, grid.wcs)
    assert words in str(caught.value)


def test_map_may_be_off_by_less_than_half_a_pixel_or_have_no_wcs(tmp_path, grid):
    assert read_exposure_map(map_file(tmp_path, np.ones(SHAPE), CRPIX1=16.9), SHAPE, grid.wcs).all()
    bare = write_image(tmp_path / "bare.fits", np.ones(SHAPE), fits.Header())
    assert read_exposure_map(bare, SHAPE, grid.wcs).all()


@pytest.mark.parametrize(
    ("bunit", "option", "per_pixel"),
    [
        ("", None, 3.0),
        ("counts/pixel", None, 3.0),
        ("count", None, 3.0),
        ("ct/arcmin**2", None, 3.0 * PIXEL_ARCMIN2),
        ("cts/s/pixel", None, 300.0),
        ("count / (s arcmin2)", None, 300.0 * PIXEL_ARCMIN2),
        ("furlong", "count/arcmin2", 3.0 * PIXEL_ARCMIN2),
    ],
)
def test_background_is_in_counts_per_pixel_whatever_the_unit(tmp_path, grid, bunit, option, per_pixel):
    path = map_file(tmp_path, np.full(SHAPE, 3.0), BUNIT=bunit)
    background = read_background_map(path, grid, np.full(SHAPE, 100.0), option)
    np.testing.assert_allclose(background, per_pixel, rtol=1e-6)


def test_background_may_be_nan_only_where_nothing_was_observed(tmp_path, grid):
    path = map_file(tmp_path, spoilt(np.nan))
    assert read_background_map(path, grid, spoilt(0.0))[2, 3] == 0.0
    with pytest.raises(BadInput, match="finite where there is exposure"):
        read_background_map(path, grid, np.full(SHAPE, 100.0))


@pytest.mark.parametrize(("values", "unit"), [(spoilt(-1.0), None), (np.ones(SHAPE), "erg"), (np.ones((3, 3)), None)])
def test_unusable_background_map_is_refused(tmp_path, grid, values, unit):
    with pytest.raises(BadInput):
        read_background_map(map_file(tmp_path, values), grid, np.ones(SHAPE), unit)


@pytest.mark.parametrize(
    ("unit", "rate_cps"),
    [
        ("ct/s", 2.0),
        ("count/s/pixel", 2.0),
        ("ct/s/arcmin2", 2.0 * PIXEL_ARCMIN2),
        ("erg/s/cm2", 2.0 / 4e-12),
        ("erg/s/cm2/arcmin2", 2.0 / 4e-12 * PIXEL_ARCMIN2),
        ("W m-2", 2e3 / 4e-12),
    ],
)
def test_sky_image_becomes_count_rates_per_pixel(tmp_path, unit, rate_cps):
    path = map_file(tmp_path, np.full(SHAPE, 2.0), BUNIT=unit)
    sky = read_sky_image(path, flux_per_rate_cgs=4e-12)
    assert sky.scale_arcsec == pytest.approx(SCALE_ARCSEC)
    np.testing.assert_allclose(sky.rate_cps, rate_cps, rtol=1e-6)


def test_sky_image_needs_a_unit_and_a_scale_and_flux_needs_a_conversion(tmp_path):
    path = map_file(tmp_path, np.ones(SHAPE))
    with pytest.raises(BadInput, match="needs a unit"):
        read_sky_image(path)
    with pytest.raises(BadInput, match="unit must be one of"):
        read_sky_image(path, unit="erg/s/cm2")
    bare = write_image(tmp_path / "bare.fits", np.ones(SHAPE), fits.Header())
    with pytest.raises(BadInput, match="no WCS where one is needed"):
        read_sky_image(bare, unit="ct/s")
    assert read_sky_image(bare, unit="ct/s", pixel_scale_arcsec=1.5).scale_arcsec == 1.5


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
def test_unusable_sky_brightness_is_refused(tmp_path, value):
    with pytest.raises(BadInput, match="sky brightness"):
        read_sky_image(map_file(tmp_path, spoilt(value)), unit="ct/s")


def test_a_counts_image_is_no_exposure_map_of_a_larger_one(tmp_path, grid):
    with pytest.raises(BadInput, match="must have the 32 × 24 pixels"):
        read_exposure_map(write_image(tmp_path / "a.fits", sample_counts((40, 40))), SHAPE, grid.wcs)
