"""What is measured in source cells: counts, position, shape, half-count radius, share of the PSF.

Idea     sums of photons and background over the cell; centroid and second moments of the photons in it.
Source   Freeman et al. 2002, ApJS 138, 185, Sect. 4; CIAO source lists (names of the columns). Position errors are
         ours: the original's, from the spread of the photons alone, are 1.4 times too small at 120 counts and 0.18
         counts per pixel, for the edge of the cell is chance.
Limits   no correction for what falls outside the cell unless asked for; the background inside the cell widens the
         ellipse. The hill follows the noise of the photons it is measured on, so faint sources gain. Position errors
         are on the safe side: the scatter of isolated sources is 0.75 to 0.88 of them (30 to 1000 counts).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from survey_mc.detect._shared.rows import Values
from survey_mc.types import FloatArray, Psf

Float32Image = NDArray[np.float32]

STEP_PER_SIGMA = 0.07  # width of the rings of the growth curve, in units of the flux scale …
N_STEPS = 512  # … so that they reach 36 flux scales
STEPS_JOINED = 8  # rings of the growth curve that make one ring of the PSF's share
PIXEL_VARIANCE = 1.0 / 12.0  # pix², of a photon somewhere in its pixel
LEAST_NET_COUNTS = 1.0  # cells with fewer have no centroid of net counts
GEHRELS_OFFSET = 0.75


@dataclass(frozen=True, slots=True)
class FluxImage:
    """What cells are cut from and measured on, float32 (ny, nx).

    flux: smoothed photons − background, −inf where not observed; floor: cells are above it; background_area_pix: pixels
    the background was averaged over (inf: known).
    """

    flux: Float32Image
    floor: float
    sigma_pix: float
    photons: Float32Image
    background: Float32Image
    background_area_pix: float


def principal_axes(xx: FloatArray, yy: FloatArray, xy: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """1σ semi-axes (pix, larger first, at least that of one pixel) and the angle of the larger from +x to +y (deg)."""
    mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    angle = np.degrees(0.5 * np.arctan2(2.0 * xy, xx - yy))
    return np.sqrt(np.maximum(mean + half, PIXEL_VARIANCE)), np.sqrt(np.maximum(mean - half, PIXEL_VARIANCE)), angle


def psf_shares(area: FloatArray, step_arcsec: float, step_pix: float, psf: Psf) -> FloatArray:
    """Share of a point source's photons that each cell holds; area: pix² of the cell in rings about the centroid.

    Rings are joined, so that the points a pixel is spread over do not show; the innermost counts as held.
    """
    edges = np.arange(0, area.shape[1] + 1, STEPS_JOINED)
    joined = area.reshape(len(area), -1, STEPS_JOINED).sum(axis=2)
    covered = np.minimum(joined / (np.pi * step_pix**2 * np.diff(np.square(edges))), 1.0)
    covered[:, 0] = 1.0
    return np.asarray(covered @ np.diff(psf.encircled_energy(edges * step_arcsec)), dtype=np.float64)


def centroids(sums: FloatArray, net: bool) -> tuple[FloatArray, FloatArray]:
    """Centroid about the peak, (n, 2) x, y, and its displacement by the background under the cell.

    net: weigh by photons − background; else by the photons, with the displacement left in. A cell without net counts
    is weighed by its photons.
    """
    from survey_mc.detect._wavdetect import source_cells as kernels

    photons, background = sums[:, kernels.SUM_PHOTONS, None], sums[:, kernels.SUM_BACKGROUND, None]
    light, sky = sums[:, [kernels.SUM_X, kernels.SUM_Y]], sums[:, [kernels.SUM_BX, kernels.SUM_BY]]
    of_photons = light / np.maximum(photons, 1.0)
    positive = photons - background >= LEAST_NET_COUNTS
    of_net = np.where(positive, (light - sky) / np.where(positive, photons - background, 1.0), of_photons)
    return (of_net, np.zeros_like(of_net)) if net else (of_photons, of_photons - of_net)


def inside_image(place: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Positions (n, 2) x, y moved onto the image; a net centroid of few counts can lie outside its cell."""
    return np.clip(place, -0.5, np.array(shape[::-1]) - 0.5)


def measured_cells(
    image: FluxImage, top: NDArray[np.int32], cell: NDArray[np.int64], psf: Psf, scale_arcsec: float, net_centroid: bool
) -> Values:
    """Measurements of the cells on the given hill tops (flat indices, distinct), (n,) each.

    x_pix … r50_arcsec and background_per_pix as in the detections table, net counts in the cell; n_pix,
    background_counts, background_counts_err, x_err_photons, y_err_photons (of the cell's photons alone), major_pix,
    minor_pix (1σ), angle_deg, psf_share, at_edge, at_neighbour.
    """
    from survey_mc.detect._wavdetect import source_cells as kernels

    width = image.flux.shape[1]
    peak = np.stack([cell % width, cell // width], axis=1).astype(np.float64)
    owner = kernels.cell_owners(image.flux, top, cell.astype(np.int32), image.floor)
    sums, touches = kernels.cell_sums(owner, image.photons, image.background, image.flux, peak)
    photons, background, n_pix = (sums[:, k] for k in (kernels.SUM_PHOTONS, kernels.SUM_BACKGROUND, kernels.SUM_PIXELS))
    n_photons, counts = np.maximum(photons, 1.0), photons - background
    offset, displaced = centroids(sums, net_centroid)
    centre = inside_image(peak + offset, image.flux.shape)
    step_pix = STEP_PER_SIGMA * image.sigma_pix
    net, area = kernels.cell_profiles(owner, image.photons, image.background, centre, N_STEPS, step_pix)
    psf_share = psf_shares(area, step_pix * scale_arcsec, step_pix, psf)
    lever = np.maximum(kernels.lever_sums(owner, image.photons, centre), PIXEL_VARIANCE * n_photons[:, None])
    # A cell that reaches farther on one side keeps more of the PSF's wings there, and draws the centroid over.
    middle = sums[:, [kernels.SUM_PX, kernels.SUM_PY]] / n_pix[:, None] - offset
    displaced = np.hypot(displaced, (1.0 - psf_share[:, None]) * middle)
    position_err = np.sqrt(lever / np.square(np.maximum(counts, LEAST_NET_COUNTS))[:, None] + np.square(displaced))
    background_err = np.sqrt(background * n_pix / image.background_area_pix)
    return {
        "x_pix": centre[:, 0],
        "y_pix": centre[:, 1],
        "x_err_pix": position_err[:, 0],
        "y_err_pix": position_err[:, 1],
        "counts": counts,
        "counts_err": np.sqrt(photons + np.square(background_err)),
        "background_per_pix": background / n_pix,
        "r50_arcsec": kernels.half_radii(net, counts, step_pix) * scale_arcsec,
        "n_pix": n_pix,
        "background_counts": background,
        "background_counts_err": background_err,
        "psf_share": psf_share,
        "at_edge": (touches & kernels.TOUCHES_EDGE) != 0,
        "at_neighbour": (touches & kernels.TOUCHES_SOURCE) != 0,
        **photon_moments(sums),
    }


def photon_moments(sums: FloatArray) -> Values:
    """Second moments of the photons of a cell about their own centroid, as axes and as errors of the centroid."""
    from survey_mc.detect._wavdetect import source_cells as kernels

    n_photons = np.maximum(sums[:, kernels.SUM_PHOTONS], 1.0)
    mean_x, mean_y = sums[:, kernels.SUM_X] / n_photons, sums[:, kernels.SUM_Y] / n_photons
    xx = np.maximum(sums[:, kernels.SUM_XX] / n_photons - mean_x**2, PIXEL_VARIANCE)
    yy = np.maximum(sums[:, kernels.SUM_YY] / n_photons - mean_y**2, PIXEL_VARIANCE)
    major, minor, angle = principal_axes(xx, yy, sums[:, kernels.SUM_XY] / n_photons - mean_x * mean_y)
    return {
        "x_err_photons": np.sqrt(xx / n_photons),
        "y_err_photons": np.sqrt(yy / n_photons),
        "major_pix": major,
        "minor_pix": minor,
        "angle_deg": angle,
    }


def source_significance(counts: FloatArray, background_counts: FloatArray) -> FloatArray:
    """Net counts over Gehrels' error of the background, CIAO's SRC_SIGNIFICANCE."""
    return np.asarray(counts / (1.0 + np.sqrt(background_counts + GEHRELS_OFFSET)), dtype=np.float64)
