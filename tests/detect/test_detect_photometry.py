"""Extraction limits, Kron photometry against sep, neighbours, aperture corrections."""

from __future__ import annotations

import numpy as np
import pytest
import sep
from detect_fields import TestPsf, observe, photon_image
from scipy import ndimage

from survey_mc.detect import gauss_se
from survey_mc.detect._sextractor import photometry, sep_chain
from survey_mc.detect._sextractor.aperture_correction import aperture_fraction, smoothed_encircled_energy
from survey_mc.detect._sextractor.catalogue import aperture_values
from survey_mc.detect._sextractor.sep_chain import SepParams


def gaussian_image(sources, n_pix=120):
    """Sum of Gaussians: (x, y, flux, sigma_x, sigma_y)."""
    y, x = np.mgrid[:n_pix, :n_pix]
    image = np.zeros((n_pix, n_pix))
    for xc, yc, flux, sx, sy in sources:
        shape = np.exp(-0.5 * (((x - xc) / sx) ** 2 + ((y - yc) / sy) ** 2))
        image += flux * shape / (2 * np.pi * sx * sy)
    return image.astype(np.float32)


def extraction(image, threshold=0.2, **changes):
    params = SepParams(**changes)
    unmasked = np.zeros(image.shape, bool)
    found = sep_chain.extract(image, np.full(image.shape, threshold, np.float32), unmasked, params)
    return found, aperture_values(image, image, image, unmasked, found, params)


def test_isolated_photometry_agrees_with_sep():
    image = gaussian_image([(30.3, 40.7, 900.0, 2.0, 1.6), (80.1, 75.4, 400.0, 2.5, 2.5)])
    found, values = extraction(image)
    o = found.objects
    ellipses = (o["x"], o["y"], o["a"], o["b"], o["theta"])
    radius, _ = sep.kron_radius(image, *ellipses, 6.0)
    np.testing.assert_allclose(values["kron_radius"], np.clip(radius, 1.4, 6.0), rtol=1e-4)
    total, _, _ = sep.sum_ellipse(image, *ellipses, 2.5 * values["kron_radius"], subpix=5)
    np.testing.assert_allclose(values["counts"], total, rtol=1e-4)
    half, _ = sep.flux_radius(image, o["x"], o["y"], 6.0 * o["a"], 0.5, normflux=total, subpix=9)
    np.testing.assert_allclose(values["r50_pix"], half, atol=0.02)


def test_kron_aperture_of_a_gaussian_holds_most_of_its_light():
    found, values = extraction(gaussian_image([(60.0, 60.0, 1000.0, 2.0, 2.0)]))
    assert len(found.objects) == 1
    assert 0.93 < values["counts"][0] / 1000.0 < 1.0
    # Half of a circular Gaussian's light lies inside 1.1774 σ.
    assert values["r50_pix"][0] == pytest.approx(1.1774 * 2.0, rel=0.05)


def test_half_light_radius_is_given_in_arcsec():
    rng = np.random.default_rng(12)
    image = photon_image(rng, 0.001, [(256.0, 256.0, 40000.0)])
    rows = gauss_se.detect(observe(image), gauss_se.GaussSeParams(measure_on="raw"), rng)
    found = rows.iloc[0]
    y, x = np.repeat(np.argwhere(image), image[image > 0], axis=0).T + rng.uniform(-0.5, 0.5, (2, image.sum()))
    distance_arcsec = np.sort(np.hypot(x - found["x_pix"], y - found["y_pix"])) * 4.0
    # 40000 photons: the radius is known to 0.5 %
    assert found["r50_arcsec"] == pytest.approx(distance_arcsec[round(0.5 * found["counts"])], rel=0.02)


def test_mirrored_neighbours_leave_a_blend_its_own_flux():
    pair = [(52.0, 60.0, 1000.0, 2.0, 2.0), (63.0, 60.0, 200.0, 2.0, 2.0)]
    fluxes = {}
    for policy in ("mirror", "blank", "ignore"):
        found, values = extraction(gaussian_image(pair), neighbours=policy)
        assert len(found.objects) == 2
        fluxes[policy] = values["counts"][np.argmin(found.objects["flux"])]
    alone = extraction(gaussian_image(pair[1:]))[1]["counts"][0]
    assert fluxes["mirror"] == pytest.approx(alone, rel=0.15)
    assert fluxes["blank"] <= fluxes["mirror"]
    assert fluxes["ignore"] > 1.15 * alone


def test_pixels_of_a_mask_count_as_their_mirror_image():
    image = gaussian_image([(60.0, 60.0, 1000.0, 2.0, 2.0)])
    params = SepParams()
    masked = np.zeros(image.shape, bool)
    found = sep_chain.extract(image, np.full(image.shape, 0.2, np.float32), masked, params)
    whole = aperture_values(image, image, image, masked, found, params)
    masked[:, 63:65] = True
    holed = aperture_values(image, image, image, masked, found, params)
    assert holed["counts"][0] == pytest.approx(whole["counts"][0], rel=0.02)
    assert holed["flags"][0] & sep_chain.FLAG_APERTURE_MASKED


def test_light_that_is_not_positive_is_flagged_and_gets_the_smallest_aperture():
    image = gaussian_image([(60.0, 60.0, 50.0, 1.5, 1.5)]) - np.float32(1.5)
    _, values = extraction(image)
    assert values["flags"][0] & sep_chain.FLAG_NON_POSITIVE
    assert values["kron_radius"][0] == pytest.approx(3.5 / 2.5)


def test_half_light_radius_of_nothing_is_nan():
    image = gaussian_image([(60.0, 60.0, 50.0, 1.5, 1.5)])
    sky = np.zeros(image.shape, np.int32), np.zeros(image.shape, bool)
    centre, major = np.array([[60.0, 60.0], [20.0, 20.0]]), np.ones(2)
    radii = photometry.half_light_radii(image, *sky, centre, major, np.array([-1.0, 10.0]), 6.0, photometry.IGNORE)
    assert np.isnan(radii).all()


def crowded_image():
    rng = np.random.default_rng(3)
    return (ndimage.gaussian_filter(rng.normal(size=(200, 200)), 1.0) + 3.0).astype(np.float32)


def test_overflow_raises_the_limits_for_one_call_and_puts_them_back(monkeypatch):
    before = (sep.get_extract_pixstack(), sep.get_sub_object_limit())
    sep.set_sub_object_limit(64)
    try:
        found, _ = extraction(crowded_image(), threshold=0.1, minarea_pix=5)
        assert sep.get_sub_object_limit() == 64
    finally:
        sep.set_sub_object_limit(before[1])
    assert found.flags == sep_chain.FLAG_LIMITS_RAISED
    assert len(found.objects) > 200
    assert sep.get_extract_pixstack() == before[0]


def test_hopeless_overflow_gives_up_deblending_not_the_field(monkeypatch):
    monkeypatch.setattr(sep_chain, "RAISED_SUB_OBJECTS", 32)
    before = sep.get_sub_object_limit()
    sep.set_sub_object_limit(16)
    try:
        found, values = extraction(crowded_image(), threshold=0.1)
    finally:
        sep.set_sub_object_limit(before)
    assert found.flags & sep_chain.FLAG_NOT_DEBLENDED
    assert np.all(np.isfinite(values["counts"]))


def test_full_pixel_buffer_is_cured():
    before = sep.get_extract_pixstack()
    sep.set_extract_pixstack(1000)
    try:
        found, _ = extraction(crowded_image(), threshold=0.1, deblend_contrast=1.0)
        assert sep.get_extract_pixstack() == 1000
    finally:
        sep.set_extract_pixstack(before)
    assert found.flags & sep_chain.FLAG_LIMITS_RAISED


def test_other_errors_of_sep_are_not_swallowed(monkeypatch):
    def broken(*args, **kwargs):
        raise Exception("memory is gone")

    monkeypatch.setattr(sep_chain.sep, "extract", broken)
    with pytest.raises(Exception, match="memory is gone"):
        extraction(crowded_image())


def test_unsmoothed_encircled_energy_is_the_psf():
    radius = np.array([3.0, 7.5, 30.0])
    np.testing.assert_allclose(smoothed_encircled_energy(radius, TestPsf(), 0.0), TestPsf().encircled_energy(radius))
    assert smoothed_encircled_energy(np.array([7.5]), TestPsf(), 0.0)[0] == pytest.approx(0.5, abs=0.002)


def test_smoothed_encircled_energy_agrees_with_photons():
    rng = np.random.default_rng(6)
    n, sigma_arcsec = 200_000, 5.096
    psf = TestPsf()
    u = rng.random(n)
    radius = psf.core_radius_arcsec * np.sqrt((1.0 - u) ** (1.0 / (1.0 - psf.slope)) - 1.0)
    moved = np.hypot(radius + rng.normal(0, sigma_arcsec, n), rng.normal(0, sigma_arcsec, n))
    apertures = np.array([6.0, 12.0, 25.0, 60.0])
    found = [(moved < r).mean() for r in apertures]
    # Binomial error of 2e5 photons is at most 0.0011: 4σ.
    np.testing.assert_allclose(smoothed_encircled_energy(apertures, psf, sigma_arcsec), found, atol=0.0045)
    np.testing.assert_allclose(aperture_fraction(apertures, psf, sigma_arcsec), found, atol=0.006)


def test_aperture_correction_restores_the_counts_of_a_point_source():
    sources = [(x + 0.2, y - 0.3, 3000.0) for x in (64, 192, 320, 448) for y in (64, 192, 320, 448)]
    observation = observe(photon_image(np.random.default_rng(14), 0.178, sources))
    params = gauss_se.GaussSeParams(background="clipped_mean", rms="analytic", aperture_correction="psf_table")
    frame = gauss_se.detect(observation, params, np.random.default_rng(0))
    bright = frame[frame["counts"] > 1000]
    assert len(bright) == len(sources)
    # Sixteen sources of 3000 photons know their mean to 0.5 %; the unmodelled part is the ellipse and the local mesh.
    assert bright["counts"].mean() / 3000.0 == pytest.approx(1.0, abs=0.05)
