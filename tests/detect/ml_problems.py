"""Small images and problems for the maximum-likelihood fit, with the PSF integrated in two dimensions."""

from __future__ import annotations

import numpy as np
from detect_fields import SCALE_ARCSEC, TestPsf

from survey_mc.detect._eml import fit as ml_fit
from survey_mc.detect._eml.params import MlFitParams, fit_limits
from survey_mc.detect._eml.pixels import Images, collect
from survey_mc.detect._eml.selection import Problem

PSF = TestPsf()


def exact_pixels(half: int, dx: float, dy: float, nodes: int = 16) -> np.ndarray:
    """PSF integrated over each pixel by Gauss-Legendre sums in two dimensions."""
    at, weight = np.polynomial.legendre.leggauss(nodes)
    place = np.arange(-half, half + 1)
    x = (place[:, None] + at / 2 - dx)[None, None]
    y = (place[:, None] + at / 2 - dy)[:, :, None, None]
    density = PSF.surface_brightness(np.hypot(x, y) * SCALE_ARCSEC) * SCALE_ARCSEC**2
    return np.einsum("iajb,a,b->ij", density, weight, weight) / 4.0


def source_rows(*rows: tuple[float, float, float], place: float | None = None) -> np.ndarray:
    """Sources (x, y, counts), free to move by 5 pixels; extended if a place on the sequence of extents is given."""
    sources = np.zeros((len(rows), ml_fit.N_SOURCE_COLUMNS))
    sources[:, :3] = rows
    if place is not None:
        sources[:, ml_fit.EXTENT], sources[:, ml_fit.IS_EXTENDED] = place, 1.0
    sources[:, [ml_fit.X_LOW, ml_fit.Y_LOW]] = sources[:, :2] - 5.0
    sources[:, [ml_fit.X_HIGH, ml_fit.Y_HIGH]] = sources[:, :2] + 5.0
    return sources


def square_images(counts: np.ndarray, background: float) -> Images:
    return Images(counts.astype(float), np.full(counts.shape, background), np.ones(counts.shape))


def problem_of(counts: np.ndarray, background: float, table, radius: float = 15.0, **changes) -> Problem:
    """All pixels within a radius of the middle of a square image."""
    images = square_images(counts, background)
    middle = (counts.shape[0] - 1) / 2.0
    params = MlFitParams(n_max_fit=2, n_mul_sou=1, det_ml_scale="correct", **changes)
    limits = fit_limits(params, PSF, SCALE_ARCSEC, counts.shape, table.extent_pix)
    return Problem(collect(images, source_rows((middle, middle, 1.0)), radius), table.cubics, limits)
