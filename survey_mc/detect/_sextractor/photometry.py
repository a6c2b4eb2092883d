"""Kron and half-light photometry of segmented objects, with SExtractor's treatment of neighbours.

Idea     Kron radius r_K = Σ r I / Σ I inside an ellipse, aperture = max(k r_K, R_min)·(A, B), half-light radius from
         the growth curve in circles. A pixel that belongs to a neighbour, or was not observed, is replaced by the pixel
         opposite to it through the object's centre (SExtractor's MASK_TYPE CORRECT), or left empty, or taken as it is.
Source   Kron 1980 ApJS 43, 305; Bertin & Arnouts 1996 A&AS 117, 393.
Limits   pixel sums with 5 × 5 sub-pixels at the aperture's edge. sep's own sums agree for isolated objects; in
         crowded fields they scale the unmasked rest, core included, up to the whole aperture: blends become too bright.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Image = NDArray[np.float32]
Segments = NDArray[np.int32]
Mask = NDArray[np.bool_]
Values = NDArray[np.float64]

IGNORE, BLANK, MIRROR = 0, 1, 2  # what a neighbour's pixel counts as
SUBSAMPLES = 5  # per pixel side
PIXEL_REACH = 0.75  # a pixel's corner is nearer than this to its centre
GROWTH_STEP_PIX = 0.1  # resolution of the growth curve
GROWTH_START = 3.0  # first search of the half-light radius, in units of a

HAS_TRUNCATION, HAS_BLOCKED = 1, 2


@njit(cache=True)
def is_blocked(segments: Segments, masked: Mask, y: int, x: int, owner: int, policy: int) -> bool:
    """Not observed, or another object's (unless neighbours are ignored)."""
    if masked[y, x]:
        return True
    segment = segments[y, x]
    return policy != IGNORE and segment != 0 and segment != owner


@njit(cache=True)
def pixel_value(
    image: Image, segments: Segments, masked: Mask, y: int, x: int, owner: int, xc: float, yc: float, policy: int
) -> float:
    """Value a pixel counts with in the object's aperture."""
    if not is_blocked(segments, masked, y, x, owner, policy):
        return float(image[y, x])
    if policy == MIRROR:
        opposite_x, opposite_y = math.floor(2.0 * xc - x + 0.5), math.floor(2.0 * yc - y + 0.5)
        inside = 0 <= opposite_x < image.shape[1] and 0 <= opposite_y < image.shape[0]
        if inside and not is_blocked(segments, masked, opposite_y, opposite_x, owner, policy):
            return float(image[opposite_y, opposite_x])
    return 0.0


@njit(cache=True)
def reduced_radius(dx: float, dy: float, shape: Values) -> float:
    """Elliptical radius in units of the axes; shape: (cxx, cyy, cxy)."""
    return math.sqrt(max(shape[0] * dx * dx + shape[1] * dy * dy + shape[2] * dx * dy, 0.0))


@njit(cache=True)
def bounding_box(xc: float, yc: float, shape: Values, reach: float, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """First and last column, first and last row (inclusive) that an ellipse of the given reach can touch."""
    determinant = shape[0] * shape[1] - 0.25 * shape[2] * shape[2]
    half_x, half_y = reach * math.sqrt(shape[1] / determinant), reach * math.sqrt(shape[0] / determinant)
    first_x, last_x = math.floor(xc - half_x), math.ceil(xc + half_x)
    first_y, last_y = math.floor(yc - half_y), math.ceil(yc + half_y)
    return max(first_x, 0), min(last_x, size[1] - 1), max(first_y, 0), min(last_y, size[0] - 1)


@njit(cache=True)
def kron_radii(
    image: Image, segments: Segments, masked: Mask, centre: Values, shape: Values, reach: float, policy: int
) -> Values:
    """r_K in reduced units inside the ellipse of the given reach; NaN where the light there is not positive.

    centre: (n, 2) x, y; shape: (n, 3) cxx, cyy, cxy of objects 1 … n of the segmentation map.
    """
    radii = np.empty(len(centre))
    for i in range(len(centre)):
        xc, yc = centre[i]
        x0, x1, y0, y1 = bounding_box(xc, yc, shape[i], reach, image.shape)
        light, moment = 0.0, 0.0
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                radius = reduced_radius(x - xc, y - yc, shape[i])
                if radius <= reach and not is_blocked(segments, masked, y, x, i + 1, policy):
                    light += image[y, x]
                    moment += radius * image[y, x]
        radii[i] = moment / light if light > 0.0 and moment > 0.0 else np.nan
    return radii


@njit(cache=True)
def covered_share(dx: float, dy: float, shape: Values, stretch: float, margin: float) -> float:
    """Share of the pixel at (dx, dy) from the centre that lies inside the stretched ellipse."""
    radius = reduced_radius(dx, dy, shape)
    if radius <= stretch - margin:
        return 1.0
    if radius >= stretch + margin:
        return 0.0
    inside = 0
    for j in range(SUBSAMPLES):
        for k in range(SUBSAMPLES):
            sub_x = dx + (k + 0.5) / SUBSAMPLES - 0.5
            sub_y = dy + (j + 0.5) / SUBSAMPLES - 0.5
            if reduced_radius(sub_x, sub_y, shape) <= stretch:
                inside += 1
    return inside / (SUBSAMPLES * SUBSAMPLES)


@njit(cache=True)
def ellipse_sums(
    image: Image,
    raw: Image,
    segments: Segments,
    masked: Mask,
    centre: Values,
    shape: Values,
    minor: Values,
    stretch: Values,
    policy: int,
) -> tuple[Values, Values, NDArray[np.int32]]:
    """Sums of two images inside the stretched ellipses, and HAS_TRUNCATION | HAS_BLOCKED bits.

    minor: (n,) minor rms axis (pix); stretch: (n,) factor on the axes.
    """
    sums, raw_sums, flags = np.zeros(len(centre)), np.zeros(len(centre)), np.zeros(len(centre), np.int32)
    for i in range(len(centre)):
        xc, yc = centre[i]
        margin = PIXEL_REACH / minor[i]
        x0, x1, y0, y1 = bounding_box(xc, yc, shape[i], stretch[i] + margin, image.shape)
        if x0 == 0 or y0 == 0 or x1 == image.shape[1] - 1 or y1 == image.shape[0] - 1:
            flags[i] |= HAS_TRUNCATION
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                share = covered_share(x - xc, y - yc, shape[i], stretch[i], margin)
                if share > 0.0:
                    sums[i] += share * pixel_value(image, segments, masked, y, x, i + 1, xc, yc, policy)
                    raw_sums[i] += share * pixel_value(raw, segments, masked, y, x, i + 1, xc, yc, policy)
                    if is_blocked(segments, masked, y, x, i + 1, policy):
                        flags[i] |= HAS_BLOCKED
    return sums, raw_sums, flags


@njit(cache=True)
def half_light_radii(
    image: Image,
    segments: Segments,
    masked: Mask,
    centre: Values,
    major: Values,
    total: Values,
    reach: float,
    policy: int,
) -> Values:
    """Radius (pix) of the circle that holds half of `total`, searched inside reach × major; NaN if not found there.

    The growth curve is built in a small circle first and in larger ones only if half of the light is not in it.
    """
    radii = np.full(len(centre), np.nan)
    for i in range(len(centre)):
        xc, yc = centre[i]
        limit, searched = reach * major[i], min(GROWTH_START, reach) * major[i]
        while total[i] > 0.0:
            growth = np.zeros(int(searched / GROWTH_STEP_PIX) + 1)
            for y in range(max(int(yc - searched), 0), min(int(yc + searched) + 2, image.shape[0])):
                for x in range(max(int(xc - searched), 0), min(int(xc + searched) + 2, image.shape[1])):
                    if math.hypot(x - xc, y - yc) > searched + 1.0:
                        continue
                    value = pixel_value(image, segments, masked, y, x, i + 1, xc, yc, policy)
                    for j in range(SUBSAMPLES):
                        for k in range(SUBSAMPLES):
                            dx = x - xc + (k + 0.5) / SUBSAMPLES - 0.5
                            dy = y - yc + (j + 0.5) / SUBSAMPLES - 0.5
                            step = int(math.sqrt(dx * dx + dy * dy) / GROWTH_STEP_PIX)
                            if step < len(growth):
                                growth[step] += value / (SUBSAMPLES * SUBSAMPLES)
            light, step = 0.0, 0
            while step < len(growth) and light + growth[step] < 0.5 * total[i]:
                light += growth[step]
                step += 1
            if step < len(growth):
                radii[i] = (step + (0.5 * total[i] - light) / growth[step]) * GROWTH_STEP_PIX
                break
            if searched >= limit:
                break
            searched = min(2.0 * searched, limit)
    return radii
