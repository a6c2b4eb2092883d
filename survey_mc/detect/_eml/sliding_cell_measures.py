"""What is measured of the candidates of a sliding cell: positions, counts and their errors.

Idea     everything is a sum over the small squares around the candidates, taken at once for all of a run. The mean
         position of the photons in a box is freed of the background and of the truncation by the box; net counts are
         divided by the share of the PSF in the box, less what spills into the frame.
Source   SAS task eboxdetect (Watson et al. 2009, A&A 493, 339, Sect. 4.4) for the counts; positions: moments.
Limits   the PSF is averaged over the place of the source within its pixel. Faint candidates are too bright by their
         selection: the box is the likeliest of its neighbours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from survey_mc.types import FloatArray, FloatImage, Psf

Indices = NDArray[np.int64]

NODES_PER_PIXEL = 8  # Gauss-Legendre, for a PSF as wide as a pixel
MOST_NODES_PER_PIXEL = 64
LEAST_PSF_FRACTION = 0.05  # of a box that is almost all masked
LEAST_EXCESS = 1.0  # photons; a likely box has more, one of an image without noise may have none
PIXEL_VARIANCE = 1.0 / 12.0  # of a photon's place within its pixel


@dataclass(frozen=True, slots=True)
class Images:
    """What is searched. weight: what the background is proportional to: the exposure in local mode, its map in map
    mode. sums: (2, …) integral images of counts and weight with a margin (pix) of zeros."""

    counts: FloatImage
    exposure: FloatImage
    weight: FloatImage
    sums: FloatArray
    margin: int
    local: bool


@dataclass(frozen=True, slots=True)
class Run:
    """Cells of one run: side of the box, pixels binned, pixels from cell to cell."""

    side: int
    factor: int
    step: int


def psf_stamp(psf: Psf, scale_arcsec: float, half_pix: int) -> FloatImage:
    """Share of the photons in each pixel of a (2 half + 1)² stamp, for sources anywhere in the middle pixel.

    The mean over the source's place within its pixel turns the pixel into a pyramid, the pixel convolved with itself.
    """
    finer = max(1.0, scale_arcsec / psf.fwhm_arcsec)
    n_nodes = min(math.ceil(NODES_PER_PIXEL * finer), MOST_NODES_PER_PIXEL)
    nodes, weights = np.polynomial.legendre.leggauss(n_nodes)
    part = np.tile(0.5 * (nodes + 1.0), half_pix + 1)
    place = np.repeat(np.arange(half_pix + 1), n_nodes)
    weight = 0.5 * np.tile(weights, half_pix + 1)
    share = np.zeros((half_pix + 2, part.size))  # of a photon at place + part in the pixels on either side
    columns = np.arange(part.size)
    share[place, columns] = weight * (1.0 - part)
    share[place + 1, columns] = weight * part
    share[0] *= 2.0  # the other side of the middle pixel
    distance_arcsec = (place + part) * scale_arcsec
    density = psf.surface_brightness(np.hypot(distance_arcsec[:, None], distance_arcsec))
    quadrant = share[:-1] @ density @ share[:-1].T * scale_arcsec**2
    mirror = np.abs(np.arange(-half_pix, half_pix + 1))
    return np.ascontiguousarray(quadrant[np.ix_(mirror, mirror)])


def windows(image: FloatImage, low_y: Indices, low_x: Indices, side: int) -> FloatArray:
    """(n, side, side) squares of an image, 0 beyond its border."""
    height, width = image.shape
    y, x = low_y[:, None] + np.arange(side), low_x[:, None] + np.arange(side)
    row, column = np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)
    values: FloatArray = np.take(image, row[:, :, None] * width + column[:, None, :])
    values *= (row == y)[:, :, None]
    values *= (column == x)[:, None, :]
    return values


def first_moments(boxes: FloatArray) -> FloatArray:
    """(3, n): sum of each box and its mean x and y, from its centre (pix); 0 where the sum is 0."""
    pixel = np.arange(boxes.shape[1]) - (boxes.shape[1] - 1) / 2.0
    total = boxes.sum(axis=(1, 2))
    inverse = np.divide(1.0, total, out=np.zeros(len(total)), where=total > 0.0)
    return np.stack([total, boxes.sum(axis=1) @ pixel * inverse, boxes.sum(axis=2) @ pixel * inverse])


def truncation(stamp: FloatImage, half: int) -> float:
    """By how much the mean position of the photons in a box follows a source that moves away from its middle."""
    middle, side = stamp.shape[0] // 2, 2 * half + 1
    low = middle - half
    shifted = np.stack([stamp[low : low + side, low - shift : low - shift + side] for shift in (-1, 1)])
    return float(np.diff(first_moments(shifted)[1])[0] / 2.0)


def positions(
    images: Images, place: tuple[Indices, Indices], mean: FloatArray, run: Run, stamp: FloatImage
) -> FloatArray:
    """(5, n): counts in the boxes, x and y and their errors (pix).

    place: row and column of the lower corners; mean: background in the boxes. The mean position of the photons, freed
    of the background's pull and, in the first run, of what the box cuts off of the PSF; else it would lie near the
    middle of the box, whichever box chance has made the likeliest.
    """
    side, half = run.side, (run.side - 1) / 2.0
    seen, weight = windows(images.exposure, *place, side), windows(images.weight, *place, side)
    photons = windows(images.counts, *place, side) * (seen > 0.0)
    n, x, y = first_moments(photons)
    _, sky_x, sky_y = first_moments(weight * (seen > 0.0))
    psf_x, psf_y, follows = 0.0, 0.0, 1.0
    if run.factor == 1:
        cut = stamp.shape[0] // 2 - side // 2
        _, psf_x, psf_y = first_moments(seen * stamp[cut : cut + side, cut : cut + side])
        follows = truncation(stamp, side // 2)
    pixel2 = np.square(np.arange(side) - half)
    excess = np.maximum(n - mean, LEAST_EXCESS)
    steepness = n / (excess * follows)
    x_variance = photons.sum(axis=1) @ pixel2 / n - np.square(x) + PIXEL_VARIANCE
    y_variance = photons.sum(axis=2) @ pixel2 / n - np.square(y) + PIXEL_VARIANCE
    off_x = ((n * x - mean * sky_x) / excess - psf_x) / follows
    off_y = ((n * y - mean * sky_y) / excess - psf_y) / follows
    height, width = images.counts.shape
    x_pix = np.clip(place[1] + half + np.clip(off_x, -half, half), 0.0, width - 1.0)
    y_pix = np.clip(place[0] + half + np.clip(off_y, -half, half), 0.0, height - 1.0)
    return np.stack([n, x_pix, y_pix, np.sqrt(x_variance / n) * steepness, np.sqrt(y_variance / n) * steepness])


def moved_from_gaps(
    images: Images, x: FloatArray, y: FloatArray, first_y: Indices, first_x: Indices, factor: int
) -> tuple[FloatArray, FloatArray]:
    """Positions (pix), but the first observed pixel of the central block where one lies in a gap between photons."""
    blocks = windows(images.exposure, first_y, first_x, factor).reshape(len(y), factor**2)
    observed = np.argmax(blocks > 0.0, axis=1)
    lost = images.exposure[np.floor(y + 0.5).astype(np.int64), np.floor(x + 0.5).astype(np.int64)] <= 0.0
    return np.where(lost, first_x + observed % factor, x), np.where(lost, first_y + observed // factor, y)


def psf_fractions(
    images: Images, y: Indices, x: Indices, half: int, widths: FloatArray, stamp: FloatImage
) -> FloatArray:
    """Expected photons of a source in the middle pixel inside windows of half-size half + width, per unit rate."""
    fractions = np.zeros(len(y))
    for width in np.unique(widths):
        reach, rows = half + int(width), np.flatnonzero(widths == width)
        side, cut = 2 * reach + 1, stamp.shape[0] // 2 - reach
        kernel = stamp[cut : cut + side, cut : cut + side]
        seen = windows(images.exposure, y[rows] - reach, x[rows] - reach, side)
        fractions[rows] = np.einsum("nij,ij->n", seen, kernel)
    return fractions


def net_counts(
    local: bool, values: FloatArray, n: FloatArray, fractions: tuple[FloatArray, FloatArray], here: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """PSF-complete counts, their error, background of the source's pixel, area of the box in such pixels.

    values: rows of the kernel; n: counts in the box; fractions: of the PSF in box and frame, relative to the exposure
    at the source; here: weight of the source's pixel.
    """
    box, frame = fractions
    mean, in_frame, frame_weight, _ = values.T
    if not local:
        effective = np.maximum(box, LEAST_PSF_FRACTION)
        return (n - mean) / effective, np.sqrt(n) / effective, here, mean / here
    ratio = mean / np.maximum(in_frame, 1.0)  # weight of the box per weight of the frame
    effective = np.maximum(box - frame * ratio, LEAST_PSF_FRACTION)
    net = (n - in_frame * ratio) / effective
    net_err = np.sqrt(n + in_frame * np.square(ratio)) / effective
    background = np.maximum(in_frame - net * frame, 0.0) / frame_weight * here
    return net, net_err, background, ratio * frame_weight / here
