"""Whose photons a detection rests on.

Idea     the photons inside a circle around each detection, counted by the source they came from. Photons are stored
         by row and x, so a circle is a few runs of consecutive photons; each is then tested at its exact position. The
         photons of a ring around the circle, of the same area, say how many of a source's only pass by.
Source   Liu et al. 2022, A&A 661, A27: identification by the origin of each photon.
Limits   circles only; the radius is max(origin radius, r50), never more than `aperture_max_arcsec`. A circle is cut
         at the image edge, and so is its ring. The background expected inside uses 5 × 5 points in the pixels the
         circle crosses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from survey_mc.match.params import MatchParams
from survey_mc.types import Field, FloatArray, IntImage

SUBPIXELS = 5
RING_REACH = np.sqrt(2.0)  # outer radius of the ring of equal area, in radii of the circle
HALF_DIAGONAL_PIX = np.sqrt(0.5)


@dataclass(frozen=True, slots=True)
class Shares:
    """Photons of each source in each aperture: one entry for each (detection, source) pair that shares any.

    detection, source: row of the detection, source_id. n_photons: photons shared. n_around: the source's photons in
    a ring of equal area around the aperture. n_background and background_expected: (n_detections,) background photons
    in each aperture, drawn and expected.
    """

    detection: NDArray[np.int64]
    source: NDArray[np.int64]
    n_photons: NDArray[np.int64]
    n_around: NDArray[np.int64]
    n_background: NDArray[np.int64]
    background_expected: FloatArray


def aperture_radius_arcsec(r50_arcsec: FloatArray, params: MatchParams) -> FloatArray:
    """Radius (arcsec) of each detection's photon aperture; a NaN r50 takes the origin radius."""
    radius = np.fmax(r50_arcsec, params.origin_radius_arcsec)
    return np.asarray(np.minimum(radius, params.aperture_max_arcsec), dtype=np.float64)


def photon_shares(field: Field, x_pix: FloatArray, y_pix: FloatArray, radius_arcsec: FloatArray) -> Shares:
    """Count the photons in circles by origin.

    x_pix, y_pix, radius_arcsec: (n,) finite. A field without a photon list counts photons at their pixel centres.
    """
    shape = field.observation.counts.shape
    photons_pix = field.observation.photons_pix
    if photons_pix is None:
        photons_pix = _pixel_centres(field.observation.counts)
    radius_pix = radius_arcsec / field.observation.grid.scale_arcsec
    pairs, n_background = _count_by_origin(
        x_pix, y_pix, radius_pix, photons_pix, field.origin, field.row_start, shape, len(field.truth_rows)
    )
    expected = _sum_in_circles(x_pix, y_pix, radius_pix, field.background_expected)
    detection, source, n_photons, n_around = np.ascontiguousarray(pairs.T)
    return Shares(detection, source, n_photons, n_around, n_background, expected)


def _pixel_centres(counts: IntImage) -> FloatArray:
    pixel = np.repeat(np.arange(counts.size), counts.ravel())
    centres = np.column_stack((pixel % counts.shape[1], pixel // counts.shape[1])).astype(np.float64)
    centres.setflags(write=False)
    return centres


@njit(cache=True)
def _span(centre: float, radius: float, size: int) -> tuple[int, int]:
    """First and last+1 pixel of a row or column that a circle may touch."""
    first = max(0, int(np.ceil(centre - radius - 0.5)))
    stop = min(size, int(np.floor(centre + radius + 0.5)) + 1)
    return first, stop


@njit(cache=True)
def _first_right_of(x: float, photons_pix: FloatArray, low: int, high: int) -> int:
    """The first of photons low … high − 1, in ascending x, that is not left of x; high if none."""
    while low < high:
        middle = (low + high) // 2
        if photons_pix[middle, 0] < x:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True)
def _count_by_origin(x_pix, y_pix, radius_pix, photons_pix, origin, row_start, shape, n_sources):  # type: ignore[no-untyped-def]
    """Rows (detection, source, photons, photons around), and the background photons of each detection."""
    n_detections = x_pix.shape[0]
    n_background = np.zeros(n_detections, np.int64)
    pairs = np.empty((4 * n_detections + 16, 4), np.int64)
    n_pairs = 0
    tally = np.zeros((n_sources, 2), np.int64)  # inside, around
    touched = np.empty(n_sources, np.int64)
    for d in range(n_detections):
        n_touched = 0
        radius2 = radius_pix[d] ** 2
        reach = RING_REACH * radius_pix[d]
        x_first, x_stop = _span(x_pix[d], reach, shape[1])
        y_first, y_stop = _span(y_pix[d], reach, shape[0])
        if x_first >= x_stop:
            continue
        for y in range(y_first, y_stop):
            stop = row_start[y + 1]
            for k in range(_first_right_of(x_first - 0.5, photons_pix, row_start[y], stop), stop):
                if photons_pix[k, 0] >= x_stop - 0.5:
                    break
                dx = photons_pix[k, 0] - x_pix[d]
                dy = photons_pix[k, 1] - y_pix[d]
                distance2 = dx * dx + dy * dy
                if distance2 > RING_REACH * RING_REACH * radius2:
                    continue
                source, is_around = origin[k], int(distance2 > radius2)
                if source < 0:
                    n_background[d] += 1 - is_around
                    continue
                if tally[source, 0] + tally[source, 1] == 0:
                    touched[n_touched] = source
                    n_touched += 1
                tally[source, is_around] += 1
        if n_pairs + n_touched > pairs.shape[0]:
            larger = np.empty((2 * (n_pairs + n_touched), 4), np.int64)
            for row in range(n_pairs):  # assigning slices would take seconds to compile
                for column in range(4):
                    larger[row, column] = pairs[row, column]
            pairs = larger
        for t in range(n_touched):
            source = touched[t]
            if tally[source, 0] > 0:
                pairs[n_pairs, 0] = d
                pairs[n_pairs, 1] = source
                pairs[n_pairs, 2] = tally[source, 0]
                pairs[n_pairs, 3] = tally[source, 1]
                n_pairs += 1
            tally[source, 0] = tally[source, 1] = 0
    return pairs[:n_pairs], n_background


@njit(cache=True)
def _sum_in_circles(x_pix, y_pix, radius_pix, image):  # type: ignore[no-untyped-def]
    """Sum of an image inside each circle; pixels the edge crosses count by the share of their points inside."""
    total = np.zeros(x_pix.shape[0], np.float64)
    patch = np.empty(0)
    for d in range(x_pix.shape[0]):
        radius = radius_pix[d]
        x_first, x_stop = _span(x_pix[d], radius, image.shape[1])
        y_first, y_stop = _span(y_pix[d], radius, image.shape[0])
        n_pixels = max(0, x_stop - x_first) * max(0, y_stop - y_first)
        if n_pixels > patch.size:
            patch = np.empty(2 * n_pixels)
        # Fetched before anything is decided about them: the rows are far apart in memory, and the processor asks for
        # all of them at once.
        n = 0
        for y in range(y_first, y_stop):
            for x in range(x_first, x_stop):
                patch[n] = image[y, x]
                n += 1
        n = 0
        for y in range(y_first, y_stop):
            dy = y - y_pix[d]
            for x in range(x_first, x_stop):
                dx = x - x_pix[d]
                value = patch[n]
                n += 1
                distance = np.sqrt(dx * dx + dy * dy)
                if distance > radius + HALF_DIAGONAL_PIX:
                    continue
                if distance < radius - HALF_DIAGONAL_PIX:
                    total[d] += value
                    continue
                n_inside = 0
                for j in range(SUBPIXELS):
                    v = dy + (j + 0.5) / SUBPIXELS - 0.5
                    for i in range(SUBPIXELS):
                        u = dx + (i + 0.5) / SUBPIXELS - 0.5
                        n_inside += u * u + v * v <= radius * radius
                total[d] += value * n_inside / (SUBPIXELS * SUBPIXELS)
    return total
