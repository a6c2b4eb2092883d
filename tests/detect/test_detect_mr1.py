"""The à trous transform and the MR/1 filter."""

from __future__ import annotations

import numpy as np
import pytest
from detect_fields import BACKGROUND_10KS, BACKGROUND_100KS, TestPsf, photon_image
from scipy import ndimage

from survey_mc.detect._mr1 import atrous
from survey_mc.detect._mr1 import filter as mr1
from survey_mc.detect._mr1.params import Mr1Params, check_scales, largest_n_scales

B3 = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0
NDIMAGE_BORDER = {"mirror": "mirror", "nearest": "nearest"}

# L2 norms of (projection + à trous) kernels, planes 1 … 6.
KERNEL_NORMS = (0.3537, 0.1634, 0.08147, 0.04073, 0.02036, 0.01018)

# Blank sky, ε = 1e-4: islands of the positive support in planes 1 … 5 of a 512² field, b = 0.178 and 1.78.
SUPPORT_ISLANDS = {BACKGROUND_10KS: (78.0, 13.0, 6.3, 1.5, 0.4), BACKGROUND_100KS: (40.0, 12.0, 5.5, 1.8, 1.3)}

# Counts of a pixel-centred point source whose expected peak coefficient is just significant, planes 1 … 5 (4 at 1.78).
DETECTION_LIMITS = {BACKGROUND_10KS: (32.9, 15.8, 14.7, 19.4, 31.2), BACKGROUND_100KS: (61.6, 38.9, 40.5, 57.2)}


def planes_by_ndimage(image, n_planes, mode):
    smooth, planes = image.astype(np.float64), []
    for s in range(n_planes):
        kernel = np.zeros(4 * 2**s + 1)
        kernel[:: 2**s] = B3
        coarse = ndimage.convolve1d(ndimage.convolve1d(smooth, kernel, axis=0, mode=mode), kernel, axis=1, mode=mode)
        planes.append(smooth - coarse)
        smooth = coarse
    return np.array(planes), smooth


def transform_of(image, n_planes, border=atrous.BORDER_MIRROR):
    work = atrous.Workspace.of(image.shape, n_planes)
    smooth = atrous.transform(image, work, border).copy()
    return work, smooth


@pytest.fixture(scope="module")
def noisy_image():
    return np.random.default_rng(8).poisson(1.5, (140, 97)).astype(np.float32)


@pytest.mark.parametrize("border", ["mirror", "nearest"])
def test_transform_agrees_with_ndimage(noisy_image, border):
    work, smooth = transform_of(noisy_image, 5, mr1.BORDERS[border])
    planes, last = planes_by_ndimage(noisy_image, 5, NDIMAGE_BORDER[border])
    np.testing.assert_allclose(work.planes, planes, atol=3e-6)
    np.testing.assert_allclose(smooth, last, atol=3e-6)


def test_sum_of_the_planes_is_the_image(noisy_image):
    work, smooth = transform_of(noisy_image, 5)
    rebuilt = atrous.reconstruct(smooth, work, atrous.BORDER_MIRROR, adjoint=False)
    np.testing.assert_allclose(rebuilt, noisy_image, atol=5e-6)


def test_adjoint_reconstruction_is_the_transpose_of_the_transform():
    # ⟨w(x), w(y)-weights⟩ = ⟨x, adjoint⟩ holds away from borders, where mirroring is not self-adjoint.
    rng = np.random.default_rng(2)
    image = np.zeros((129, 129), np.float32)
    image[64, 64] = 1.0
    work, _ = transform_of(image, 3)
    work.planes[:] = 0.0
    weights = rng.normal(size=(9, 9)).astype(np.float32)
    work.planes[2, 60:69, 60:69] = weights
    rebuilt = atrous.reconstruct(np.zeros_like(image), work, atrous.BORDER_MIRROR).copy()
    expected = planes_by_ndimage(image, 3, "mirror")[1] * 0.0
    kernel_sum = ndimage.convolve1d(
        np.pad(weights.astype(float), 60), np.array([1, 0, 4, 0, 6, 0, 4, 0, 1]) / 16, axis=0
    )
    kernel_sum = ndimage.convolve1d(kernel_sum, np.array([1, 0, 4, 0, 6, 0, 4, 0, 1]) / 16, axis=1)
    kernel_sum = ndimage.convolve1d(ndimage.convolve1d(kernel_sum, B3, axis=0), B3, axis=1)
    expected += np.pad(kernel_sum, 0)[: expected.shape[0], : expected.shape[1]]
    np.testing.assert_allclose(rebuilt, expected, atol=1e-5)


def test_kernel_norms():
    photon = np.zeros((257, 257))
    photon[128, 128] = 1.0
    work, _ = transform_of(mr1.project(photon, "mirror"), 6)
    norms = [np.sqrt(np.square(plane.astype(np.float64)).sum()) for plane in work.planes]
    np.testing.assert_allclose(norms, KERNEL_NORMS, rtol=5e-4)
    np.testing.assert_allclose(work.planes[0].max(), 1.0 / 3.0, rtol=0.05)


def test_box_limits_follow_the_photons_in_the_box():
    photons = np.random.default_rng(4).poisson(0.3, (90, 70)).astype(np.float64)
    table = np.arange(5000, dtype=np.float64)
    lower, upper = np.empty((90, 70), np.float32), np.empty((90, 70), np.float32)
    atrous.box_counts_limits(photons, 8, atrous.BORDER_MIRROR, -table, table, 1.0, lower, upper)
    counted = ndimage.uniform_filter(photons, 17, mode="mirror") * 17**2
    np.testing.assert_allclose(upper, np.rint(counted))
    np.testing.assert_allclose(lower, -np.rint(counted))


def test_limits_grow_as_the_root_of_n_beyond_the_table():
    photons = np.full((40, 40), 100.0)
    table = np.sqrt(np.arange(101, dtype=np.float64))
    lower, upper = np.empty((40, 40), np.float32), np.empty((40, 40), np.float32)
    atrous.box_counts_limits(photons, 2, atrous.BORDER_MIRROR, -table, table, 1.0, lower, upper)
    np.testing.assert_allclose(upper, np.sqrt(2500.0))


def test_isolated_pixels_are_killed_unless_the_next_plane_holds_them():
    support = np.zeros((3, 20, 20), np.uint8)
    support[0, 5, 5] = support[0, 10, 10] = support[1, 10, 10] = support[2, 15, 15] = 1
    support[0, 2, 2:4] = 1
    cleaned = atrous.kill_isolated(support)
    assert cleaned[0, 5, 5] == 0
    assert cleaned[0, 10, 10] == 1
    assert cleaned[1, 10, 10] == 0
    assert cleaned[0, 2, 2:4].sum() == 2
    assert cleaned[2, 15, 15] == 1


@pytest.mark.parametrize("reconstruction", ["sum", "adjoint"])
def test_all_coefficients_kept_returns_the_image(reconstruction):
    image = mr1.project(np.random.default_rng(3).poisson(2.0, (128, 128)).astype(float), "mirror")
    params = Mr1Params(n_scales=5, iterations=40, tolerance=1e-12, first_scale=1, reconstruction=reconstruction)
    support = np.ones((4, *image.shape), np.uint8)
    restored = mr1.iterate(image, support, np.zeros((1, 1, 1), np.float32), params)
    np.testing.assert_allclose(restored.image, image, atol=0.02)
    assert restored.image.sum(dtype=float) == pytest.approx(image.sum(dtype=float), rel=1e-5)


def test_projection_conserves_photons_away_from_the_border():
    photons = np.zeros((40, 40))
    photons[10:30, 10:30] = np.random.default_rng(1).poisson(2.0, (20, 20))
    assert mr1.project(photons, "mirror").sum(dtype=float) == pytest.approx(photons.sum())


def test_filter_conserves_the_photons():
    photons = photon_image(np.random.default_rng(9), 0.178, [(100, 120, 300.0)], n_pix=256).astype(float)
    restored = mr1.restore(photons, Mr1Params())
    assert restored.image.sum(dtype=float) == pytest.approx(photons.sum(), rel=0.01)


@pytest.mark.parametrize("background", [BACKGROUND_10KS, BACKGROUND_100KS])
def test_blank_sky_support_islands(background):
    rng = np.random.default_rng(101)
    n_fields = 6
    islands = np.zeros(5)
    params = Mr1Params(first_scale=1, kill_isolated=False)
    for _ in range(n_fields):
        photons = rng.poisson(background, (512, 512)).astype(float)
        support, _ = mr1.significant(mr1.project(photons, "mirror"), photons, params)
        islands += [ndimage.label(plane, np.ones((3, 3)))[1] for plane in support]
    expected = np.array(SUPPORT_ISLANDS[background])
    # The expected rates are themselves measured on 5 to 8 fields: 4σ of both Poisson errors, and 15 % for the
    # connectivity used to count islands.
    tolerance = 4.0 * np.sqrt(2.0 * expected / n_fields + 0.1) + 0.15 * expected
    assert np.all(np.abs(islands / n_fields - expected) < tolerance)


@pytest.mark.parametrize("background", [BACKGROUND_10KS, BACKGROUND_100KS])
def test_detection_limits_of_the_planes(background):
    half = 255
    psf = TestPsf()
    sub = (np.arange(11) - 5) / 11
    pixels = np.arange(-half, half + 1)
    fine = (pixels[:, None] + sub).ravel() * 4.0
    near = slice((half - 40) * 11, (half + 41) * 11)
    source = psf.surface_brightness(np.hypot(pixels[:, None] * 4.0, pixels[None, :] * 4.0)) * 16.0
    core = psf.surface_brightness(np.hypot(fine[near, None], fine[None, near])) * 16.0
    source[half - 40 : half + 41, half - 40 : half + 41] = core.reshape(81, 11, 81, 11).mean(axis=(1, 3))

    def signal_to_limit(counts):
        photons = background + counts * source
        work, _ = transform_of(mr1.project(photons, "mirror"), 5)
        limits = [mr1.photon_limits(photons, s, Mr1Params())[1][half, half] for s in range(5)]
        return work.planes[:, half, half] / np.array(limits)

    for plane, limit in enumerate(DETECTION_LIMITS[background]):
        assert signal_to_limit(limit * 0.94)[plane] < 1.0
        assert signal_to_limit(limit * 1.06)[plane] > 1.0


def test_growing_support_keeps_more():
    photons = photon_image(np.random.default_rng(10), 0.178, [(60, 60, 60.0)], n_pix=128).astype(float)
    fixed = mr1.restore(photons, Mr1Params(n_scales=5))
    grown = mr1.restore(photons, Mr1Params(n_scales=5, grow_support=True))
    assert grown.support.sum() >= fixed.support.sum()
    assert np.all(grown.support >= fixed.support)


def test_support_has_no_plane_finer_than_the_first_scale():
    photons = photon_image(np.random.default_rng(10), 0.178, [(60, 60, 500.0)], n_pix=128).astype(float)
    restored = mr1.restore(photons, Mr1Params(n_scales=5, first_scale=3))
    assert restored.support[:2].sum() == 0
    assert restored.support[2:].sum() > 0


def test_suppressed_last_scale_leaves_an_empty_sky():
    photons = np.full((128, 128), 1.0)
    assert mr1.restore(photons, Mr1Params(n_scales=4, suppress_last_scale=True)).image.max() == 0.0


def test_filter_is_deterministic():
    photons = photon_image(np.random.default_rng(10), 1.78, [(60, 60, 500.0)], n_pix=128).astype(float)
    first, second = mr1.restore(photons, Mr1Params(n_scales=5)), mr1.restore(photons, Mr1Params(n_scales=5))
    assert first.image.tobytes() == second.image.tobytes()


def test_too_many_scales_are_refused_by_name():
    with pytest.raises(ValueError, match=r"n_scales must be 2\.\.6 for a 100-pixel image \(got 8\)"):
        check_scales(Mr1Params(n_scales=8), (100, 300))


def test_first_scale_beyond_the_planes_is_refused_by_name():
    with pytest.raises(ValueError, match=r"first_scale must be 1\.\.3 for n_scales = 4 \(got 4\)"):
        check_scales(Mr1Params(n_scales=4, first_scale=4), (512, 512))


def test_largest_scales_still_run():
    photons = np.random.default_rng(1).poisson(1.0, (65, 80)).astype(float)
    n_scales = largest_n_scales(photons.shape)
    assert np.all(np.isfinite(mr1.restore(photons, Mr1Params(n_scales=n_scales)).image))
