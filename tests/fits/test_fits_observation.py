"""Observations from files: what was read, what was assumed."""

import math

import numpy as np
import pytest
from astropy.io import fits
from fits_samples import SHAPE, SamplePsf, sample_counts, sky_header, write_image

from survey_mc.errors import BadInput
from survey_mc.fits import observation_from_files
from survey_mc.types import Band


def test_observation_has_what_the_files_say(tmp_path):
    counts = write_image(tmp_path / "c.fits", header=sky_header(EXPOSURE=120.0, E_MIN=0.5, E_MAX=2.0))
    exposure = write_image(tmp_path / "e.fits", np.full(SHAPE, 100.0))
    background = write_image(tmp_path / "b.fits", np.full(SHAPE, 0.002), sky_header(BUNIT="ct/s"))
    read = observation_from_files(
        counts, exposure_path=exposure, background_path=background, flux_per_rate_cgs=6.7e-13, psf=SamplePsf()
    )
    observation = read.observation
    np.testing.assert_array_equal(observation.counts, sample_counts())
    np.testing.assert_array_equal(observation.exposure_s, 100.0)
    np.testing.assert_allclose(observation.background, 0.2)
    assert observation.photons_pix is None
    assert observation.band == Band("soft", 0.5, 2.0, 6.7e-13)
    assert not observation.counts.flags.writeable
    assert read.notes == ()


@pytest.mark.parametrize(
    ("cards", "given_s", "expected_s", "noted"),
    [
        ({"EXPOSURE": 50.0}, None, 50.0, False),
        ({"LIVETIME": 40.0, "ONTIME": 60.0}, None, 40.0, False),
        ({"ONTIME": 60.0}, None, 60.0, False),
        ({"EXPOSURE": 50.0}, 70.0, 50.0, False),
        ({}, 70.0, 70.0, False),
        ({}, None, 1.0, True),
        ({"EXPOSURE": -1.0}, None, 1.0, True),
    ],
)
def test_exposure_time_is_the_headers_then_the_given_one_then_one_second(tmp_path, cards, given_s, expected_s, noted):
    counts = write_image(tmp_path / "c.fits", header=sky_header(**cards))
    read = observation_from_files(counts, psf=SamplePsf(), exposure_s=given_s)
    np.testing.assert_array_equal(read.observation.exposure_s, expected_s)
    assert any("1 s is used" in note for note in read.notes) == noted
    assert any("no exposure map" in note for note in read.notes)
    assert any("70 s is not used" in note for note in read.notes) == (given_s is not None and expected_s != given_s)


def test_missing_band_and_conversion_are_noted(tmp_path):
    read = observation_from_files(write_image(tmp_path / "c.fits"), psf=SamplePsf())
    assert read.observation.band.name == "unknown"
    assert math.isnan(read.observation.band.energy_min_kev)
    assert any("energy band" in note for note in read.notes)
    assert any("fluxes are NaN" in note for note in read.notes)


def test_photons_without_exposure_are_left_out_and_noted(tmp_path):
    exposure_s = np.full(SHAPE, 100.0)
    exposure_s[:3] = 0.0
    n_outside = int(sample_counts()[:3].sum())
    path = write_image(tmp_path / "e.fits", exposure_s)
    read = observation_from_files(write_image(tmp_path / "c.fits"), exposure_path=path, psf=SamplePsf())
    assert read.observation.counts[:3].sum() == 0
    np.testing.assert_array_equal(read.observation.counts[3:], sample_counts()[3:])
    assert any(note.startswith(f"{n_outside} of the ") for note in read.notes)


def test_exposure_map_of_another_image_is_refused(tmp_path):
    exposure_s = np.zeros(SHAPE)
    exposure_s[:3] = 100.0
    path = write_image(tmp_path / "e.fits", exposure_s)
    with pytest.raises(BadInput, match="of another image"):
        observation_from_files(write_image(tmp_path / "c.fits"), exposure_path=path, psf=SamplePsf())


def test_scaled_exposure_map_is_noted(tmp_path):
    counts = write_image(tmp_path / "c.fits", header=sky_header(EXPOSURE=100.0))
    path = write_image(tmp_path / "e.fits", np.full(SHAPE, 900.0))
    read = observation_from_files(counts, exposure_path=path, psf=SamplePsf())
    assert any("seems to be scaled" in note for note in read.notes)


def test_one_file_can_hold_all_maps(tmp_path):
    header = sky_header()
    units = [fits.PrimaryHDU(sample_counts(), header), fits.ImageHDU(np.full(SHAPE, 9.0), header, name="EXPOSURE")]
    units += [fits.ImageHDU(np.full(SHAPE, 0.5), header, name="BACKGROUND")]
    fits.HDUList(units).writeto(tmp_path / "a.fits")
    path = tmp_path / "a.fits"
    read = observation_from_files(
        path,
        exposure_path=path,
        exposure_hdu="EXPOSURE",
        background_path=path,
        background_hdu="BACKGROUND",
        psf=SamplePsf(),
    )
    assert (read.observation.exposure_s.max(), read.observation.background.max()) == (9.0, 0.5)


@pytest.mark.parametrize("option", ["exposure_s", "flux_per_rate_cgs"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_numbers_that_must_be_positive_are(tmp_path, option, value):
    with pytest.raises(BadInput, match=f"{option}: must be a positive number"):
        observation_from_files(write_image(tmp_path / "c.fits"), psf=SamplePsf(), **{option: value})
