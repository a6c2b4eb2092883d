"""Pixel conventions: the first centre is (0, 0) with us and (1, 1) in FITS, under any rotation."""

import numpy as np
from astropy.coordinates import SkyCoord
from astropy.wcs import WCS
from fits_samples import sky_header
from hypothesis import given, settings
from hypothesis import strategies as st

from survey_mc.fits.wcs import (
    celestial_wcs,
    fits_from_pix,
    icrs_deg,
    misalignment_pix,
    pix_from_fits,
    pixel_scale_arcsec,
)

pixels = st.floats(-1000.0, 3000.0, allow_nan=False)
headers = st.builds(
    sky_header,
    shape=st.tuples(st.integers(8, 900), st.integers(8, 900)),
    scale_arcsec=st.floats(0.1, 20.0),
    rotation_deg=st.floats(0.0, 360.0),
    mirrored=st.booleans(),
    style=st.sampled_from(["CD", "PC"]),
    CRVAL1=st.floats(0.0, 359.99),
    CRVAL2=st.floats(-85.0, 85.0),
)


@given(x_pix=pixels)
def test_fits_pixels_and_ours_convert_back_and_forth(x_pix):
    assert fits_from_pix(np.array([0.0]))[0] == 1.0
    assert abs(pix_from_fits(fits_from_pix(np.array([x_pix])))[0] - x_pix) < 1e-9


@settings(max_examples=150, deadline=None)
@given(header=headers, x_pix=st.floats(-5.0, 900.0), y_pix=st.floats(-5.0, 900.0))
def test_sky_positions_are_those_of_fits_pixels_one_higher(header, x_pix, y_pix):
    wcs = celestial_wcs(header, "here")
    ra_deg, dec_deg = icrs_deg(wcs, np.array([x_pix]), np.array([y_pix]))
    one_based = fits_from_pix(np.array([[x_pix, y_pix]]))
    theirs = WCS(header).wcs_pix2world(one_based, 1)[0]
    distance = SkyCoord(ra_deg[0], dec_deg[0], unit="deg").separation(SkyCoord(*theirs, unit="deg"))
    assert distance.arcsec < 1e-6
    back = WCS(header).wcs_world2pix([[ra_deg[0], dec_deg[0]]], 1)[0]
    np.testing.assert_allclose(pix_from_fits(back), [x_pix, y_pix], atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(header=headers, scale_arcsec=st.floats(0.1, 20.0))
def test_measured_pixel_scale_does_not_depend_on_rotation_parity_or_place(header, scale_arcsec):
    size_deg = float(np.hypot(header.get("CD1_1", 0.0), header.get("CD2_1", 0.0))) or header["CDELT1"]
    shape = (round(2 * header["CRPIX2"] - 1), round(2 * header["CRPIX1"] - 1))
    measured = pixel_scale_arcsec(celestial_wcs(header, "here"), shape, "here")
    assert abs(measured / (size_deg * 3600.0) - 1.0) < 1e-5


@settings(max_examples=40, deadline=None)
@given(header=headers, shift_pix=st.floats(0.01, 20.0))
def test_misalignment_is_the_shift_in_pixels(header, shift_pix):
    shifted = header.copy()
    shifted["CRPIX1"] += shift_pix
    first, second = celestial_wcs(header, "here"), celestial_wcs(shifted, "there")
    assert abs(misalignment_pix(first, second, (40, 40)) - shift_pix) < 1e-3
    assert misalignment_pix(first, first, (40, 40)) < 1e-6


def test_positions_of_a_galactic_image_are_given_in_icrs():
    header = sky_header(CTYPE1="GLON-TAN", CTYPE2="GLAT-TAN", CRVAL1=0.0, CRVAL2=0.0)
    ra_deg, dec_deg = icrs_deg(celestial_wcs(header, "here"), np.array([15.5]), np.array([11.5]))
    centre = SkyCoord(0.0, 0.0, unit="deg", frame="galactic").icrs
    np.testing.assert_allclose([ra_deg[0], dec_deg[0]], [centre.ra.deg, centre.dec.deg], atol=1e-9)


def test_no_positions_have_no_coordinates():
    ra_deg, dec_deg = icrs_deg(celestial_wcs(sky_header(), "here"), np.empty(0), np.empty(0))
    assert (len(ra_deg), len(dec_deg)) == (0, 0)
