"""Background map from what the sources leave over: the cheese image and a smooth surface through it.

Idea     cut a circle out around every candidate, as far as its PSF adds noticeably to the background; bin what is left;
         fit a smooth rate to the cells; multiply by the exposure. Cells that stick out are left out and the fit is
         repeated.
Source   SAS task esplinemap (Watson et al. 2009, A&A 493, 339, Sect. 4.4.1): circles, bins and bicubic spline, model of
         two components, adaptive smoothing.
         Differs: the spline is fitted to the logarithm of the rate by Poisson likelihood, so it is unbiased at low
         counts and cannot turn negative; a penalty bridges the holes where a free spline over- and undershoots.
         Candidates that owe their likelihood to a frame with few photons by chance are put back once there is a map:
         cutting out these upward fluctuations would make it 6 % low at 0.18 counts per pixel, 1.5 % at 1.8.
Weak at  extended sources: only circles of the size of the PSF are cut, so halos stay in the map; sources below the
         threshold of the candidates, and the wings beyond the circles, count as background.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy import fft
from scipy.special import gammainc, ndtr

from survey_mc.detect._eml.poisson_spline import LogSpline, fit
from survey_mc.detect._eml.sliding_cell import Cells
from survey_mc.detect._shared.observed import granted_background, observed_pixels
from survey_mc.detect._shared.poisson_background import LEAST_BACKGROUND_PER_PIX, LEAST_COVERAGE
from survey_mc.detect.detector import DetectorParams
from survey_mc.types import BoolArray, FloatArray, FloatImage, Observation, Psf

PROFILE_ARCSEC = np.geomspace(1e-2, 3e4, 800)  # radii at which the PSF is inverted
Indices = NDArray[np.int64]

TINY = np.finfo(np.float64).tiny
CELLS_PER_INTERVAL = 2  # cells per interval of the spline
LEAST_CELLS = 4  # along the shorter side of the image
LEAST_LEFT = 0.1  # share of the observed pixels
SCUT_STEP = 4.0
MODEL_ROUNDS = 20
MODEL_SETTLED = 1e-4  # relative change of the amplitudes, far below photon noise
SMOOTHING_STEP = 2.0**0.5
N_SMOOTHINGS = 8
BINS_PER_SIGMA = 1.5  # of the narrowest Gaussian
MARGIN_SIGMA = 3.0  # of zeros between opposite borders of the Fourier transform


class CheeseSplineParams(DetectorParams):
    """Parameters of the background map."""

    background: Literal["spline", "model", "smooth", "granted"] = Field(
        "spline",
        description="map of the background: spline through the source-free cells, a vignetted plus a flat component, "
        "adaptive Gaussian smoothing, or the map the campaign grants",
    )
    scut: float = Field(
        0.01, ge=1e-5, le=10.0, description="sources are cut out where their PSF exceeds this (counts/arcsec²)"
    )
    mlmin_mask: float = Field(1.0, ge=0.0, le=500.0, description="least −ln P of a candidate that is cut out")
    like_min_again: float = Field(
        8.0,
        ge=0.0,
        le=500.0,
        description="candidates of a lower −ln P against the map itself are put back and the map is made once more; "
        "0 = never (as published)",
    )
    n_spline_nodes: int = Field(16, ge=4, le=40, description="cells along the longer side of the image")
    n_fit_run: int = Field(3, ge=1, le=20, description="number of fits, each without the cells the last one rejects")
    excess_sigma: float = Field(
        4.0, ge=2.0, le=8.0, description="cells so far above the fit are rejected (σ of a Gaussian tail)"
    )
    smooth_sigma_pix: float = Field(
        6.0, ge=1.0, le=64.0, description="narrowest of the eight Gaussians of background smooth (σ, pixels)"
    )
    snr_min: float = Field(
        30.0, ge=1.0, le=1e3, description="signal to noise background smooth widens its Gaussians for"
    )


def cut_radius_pix(psf: Psf, scale_arcsec: float, counts: FloatArray, scut: float) -> FloatArray:
    """Radius (pix) inside which sources of these counts exceed scut (counts/arcsec²); 0 if nowhere."""
    profile = np.maximum.accumulate(psf.surface_brightness(PROFILE_ARCSEC)[::-1])
    wanted = scut / np.maximum(counts, TINY)
    radius = np.interp(wanted, profile, PROFILE_ARCSEC[::-1], right=0.0)
    return np.asarray(radius / scale_arcsec)


def cell_edges(shape: tuple[int, int], params: CheeseSplineParams) -> tuple[Indices, Indices]:
    """First pixels of the cells along y and x, and the size of the image.

    About square cells, n_spline_nodes along the longer side; for the adaptive smoothing, bins it does not feel.
    """
    if params.background == "smooth":
        factor = max(int(params.smooth_sigma_pix / BINS_PER_SIGMA), 1)
        along_y, along_x = (np.append(np.arange(0, n, factor), n) for n in shape)
    else:
        n_y, n_x = (min(n, max(LEAST_CELLS, round(params.n_spline_nodes * n / max(shape)))) for n in shape)
        along_y, along_x = (np.arange(n + 1) * size // n for n, size in zip((n_y, n_x), shape, strict=True))
    return along_y, along_x


def too_bright(counts: FloatImage, expected: FloatImage, sigma: float) -> BoolArray:
    """Cells whose counts a Poisson variable of the expected mean reaches more rarely than a Gaussian `sigma`."""
    return np.asarray((counts > expected) & (gammainc(np.maximum(counts, 1.0), expected) < ndtr(-sigma)))


def spline_rate(
    counts: FloatImage, exposure: FloatImage, params: CheeseSplineParams, start: LogSpline | None
) -> LogSpline | None:
    """Background per unit exposure from cells; None without photons. start: a fit to nearly the same cells."""
    n_intervals = max(counts.shape[0] // CELLS_PER_INTERVAL, 1), max(counts.shape[1] // CELLS_PER_INTERVAL, 1)
    centre_y, centre_x = ((np.arange(n) + 0.5) / n for n in counts.shape)
    kept, spline = exposure > 0.0, start
    for _ in range(params.n_fit_run):
        if counts[kept].sum() <= 0.0:
            return None
        spline = fit(np.where(kept, counts, 0.0), np.where(kept, exposure, 0.0), n_intervals, spline)
        rejected = kept & too_bright(counts, exposure * spline.rate(centre_y, centre_x), params.excess_sigma)
        if not rejected.any():
            break
        kept = kept & ~rejected
    return spline


def components(counts: FloatImage, parts: FloatArray, params: CheeseSplineParams) -> FloatArray:
    """Amplitudes ≥ 0 of the components that make the counts of the cells likeliest (Poisson).

    parts: (n_components, n_cells). Reweighted least squares with the expected variance.
    """
    from scipy.optimize import nnls  # a driver does without

    kept = parts.sum(axis=0) > 0.0
    amplitudes = np.full(len(parts), counts[kept].sum() / max(parts[:, kept].sum(), TINY))
    for _ in range(params.n_fit_run):
        for _ in range(MODEL_ROUNDS):
            expected = np.maximum(amplitudes @ parts[:, kept], LEAST_BACKGROUND_PER_PIX)
            weight = 1.0 / np.sqrt(expected)
            before = amplitudes
            amplitudes = nnls((parts[:, kept] * weight).T, counts[kept] * weight)[0]
            if np.all(np.abs(amplitudes - before) <= MODEL_SETTLED * np.abs(amplitudes)):
                break
        rejected = kept & too_bright(counts, amplitudes @ parts, params.excess_sigma)
        if not rejected.any():
            break
        kept = kept & ~rejected
    return np.asarray(amplitudes)


def gaussian_of(transform: NDArray[np.complex128], padded: tuple[int, int], sigma: float) -> FloatImage:
    """Back from a transform, convolved with a Gaussian of unit sum (pix)."""
    along_y, along_x = fft.fftfreq(padded[0]), fft.rfftfreq(padded[1])
    damping = [np.exp(-2.0 * np.square(np.pi * sigma * f)) for f in (along_y, along_x)]
    return np.asarray(fft.irfft2(transform * damping[0][:, None] * damping[1], s=padded, overwrite_x=True))


def smooth_rate(counts: FloatImage, exposure: FloatImage, sigma: float, snr_min: float) -> FloatImage:
    """Background per unit exposure: smoothed counts over smoothed exposure, as wide as the signal to noise asks for.

    sigma: of the narrowest Gaussian (pix). The two next to snr_min interpolated; the widest where none reaches it.
    """
    height, width = counts.shape
    sigmas = sigma * SMOOTHING_STEP ** np.arange(N_SMOOTHINGS)
    margin = math.ceil(MARGIN_SIGMA * min(sigmas[-1], max(counts.shape)))
    padded = fft.next_fast_len(height + margin, real=True), fft.next_fast_len(width + margin, real=True)
    photons, seen = (fft.rfft2(image, s=padded) for image in (counts, exposure))
    rate, snr = np.full(counts.shape, counts.sum() / exposure.sum()), np.zeros(counts.shape)
    for step in sigmas:
        smoothed, coverage = (gaussian_of(t, padded, step)[:height, :width] for t in (photons, seen))
        squared = gaussian_of(photons, padded, step / SMOOTHING_STEP)[:height, :width]
        noise = np.sqrt(np.maximum(squared, TINY) / (4.0 * np.pi * step**2))  # w² is a Gaussian narrower by √2
        reached = np.where(coverage > LEAST_COVERAGE * exposure.max(), np.maximum(smoothed, 0.0) / noise, 0.0)
        gain = reached - snr
        share = np.where(gain > 0.0, np.clip((snr_min - snr) / np.where(gain > 0.0, gain, 1.0), 0.0, 1.0), 0.0)
        rate += share * (np.maximum(smoothed, 0.0) / np.maximum(coverage, TINY) - rate)
        snr += share * (reached - snr)
    return rate


def enlarged(small: FloatImage, shape: tuple[int, int], factor: int) -> FloatImage:
    """Linear interpolation between the centres of bins of factor² pixels."""
    for axis, size in enumerate(shape):
        place = np.clip((np.arange(size) + 0.5) / factor - 0.5, 0.0, small.shape[axis] - 1.0)
        low = np.minimum(place.astype(np.int64), max(small.shape[axis] - 2, 0))
        share = np.expand_dims(place - low, 1 - axis)
        high = np.minimum(low + 1, small.shape[axis] - 1)
        small = np.take(small, low, axis) * (1.0 - share) + np.take(small, high, axis) * share
    return small


def surface(
    observation: Observation,
    cells: FloatArray,
    edges: tuple[Indices, Indices],
    params: CheeseSplineParams,
    start: LogSpline | None,
) -> tuple[FloatImage, LogSpline | None]:
    """Counts per pixel of a smooth background through cells (counts, seconds, pixels), and its spline if it is one."""
    shape, longest = observation.counts.shape, observation.exposure_s.max()
    counts, exposure, area = cells[0], cells[1] / longest, cells[2]
    if counts.sum() <= 0.0:
        return np.zeros(shape), None
    if params.background == "model":
        vignetted, constant = components(counts.ravel(), np.stack([exposure.ravel(), area.ravel()]), params)
        return np.asarray(vignetted / longest * observation.exposure_s + constant), None
    spline = None
    if params.background == "smooth":
        factor = int(edges[0][1])
        rate = enlarged(smooth_rate(counts, exposure, params.smooth_sigma_pix / factor, params.snr_min), shape, factor)
    else:
        spline = spline_rate(counts, exposure, params, start)
        rate = np.zeros(shape) if spline is None else spline.rate(*((np.arange(n) + 0.5) / n for n in shape))
    rate *= observation.exposure_s
    rate /= longest
    return rate, spline


def cheese(
    observation: Observation, observed: BoolArray, cells: Cells, cut: BoolArray, params: CheeseSplineParams
) -> tuple[FloatArray, tuple[Indices, Indices]]:
    """(3, n_y, n_x) counts, seconds and pixels of the cells without the candidates `cut`, and the edges of the cells.

    Where the circles of bright candidates leave hardly anything they shrink, until enough is left.
    """
    from survey_mc.detect._eml.cheese_kernel import AREA, cheese_cells

    counts = np.ascontiguousarray(observation.counts, dtype=np.int32)
    exposure = np.ascontiguousarray(observation.exposure_s, dtype=np.float64)
    edges = cell_edges(observed.shape, params)
    scut, wanted = params.scut, LEAST_LEFT * np.count_nonzero(observed)
    while True:
        radius = cut_radius_pix(observation.psf, observation.grid.scale_arcsec, cells.counts[cut], scut)
        circles = np.stack([cells.x_pix[cut], cells.y_pix[cut], radius], axis=1)
        sums = cheese_cells(counts, exposure, circles, *edges, observed.copy())
        if sums[AREA].sum() >= wanted or not radius.any():
            return sums, edges
        scut *= SCUT_STEP


def supported(cells: Cells, background: FloatImage, like_min: float) -> BoolArray:
    """Candidates whose box holds more photons than the map lets expect, at this −ln P."""
    row, column = (np.floor(place + 0.5).astype(np.int64) for place in (cells.y_pix, cells.x_pix))
    mean = background[row, column] * cells.box_area_pix
    return np.asarray(gammainc(cells.box_counts, mean) <= math.exp(-like_min))


def background_map(observation: Observation, cells: Cells, params: CheeseSplineParams) -> FloatImage:
    """Expected background counts per pixel: > 0 on observed pixels, 0 elsewhere.

    cells: local-mode candidates, which are cut out. Raises ValueError if a granted map is asked for and there is none.
    """
    observed = observed_pixels(observation)
    if params.background == "granted":
        return np.where(observed, np.maximum(granted_background(observation), LEAST_BACKGROUND_PER_PIX), 0.0)
    if not observed.any():
        return np.zeros(observed.shape)
    cut, spline = cells.like > params.mlmin_mask, None
    background = np.zeros(observed.shape)
    for like_min in (params.like_min_again, 0.0):
        sums, edges = cheese(observation, observed, cells, cut, params)
        background, spline = surface(observation, sums, edges, params, spline)
        np.maximum(background, LEAST_BACKGROUND_PER_PIX, out=background)
        background[~observed] = 0.0
        put_back = cut & ~supported(cells, background, like_min)
        if like_min == 0.0 or not put_back.any():
            break
        cut &= ~put_back
    return background
