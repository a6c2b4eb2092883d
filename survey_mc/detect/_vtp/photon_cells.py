"""Photons as Voronoi cells: distinct positions, how many photons each holds, and the area it has to itself.

Idea     positions lie on a grid of 2^−bits pixels (6e-5 pixels for 512 × 512), fine enough not to matter and coarse
         enough that the tessellation is exact. A photon known to its pixel only sits in the pixel's centre, where it
         shares one cell with the others there, or is thrown uniformly into the pixel.
Source   Ebeling & Wiedenmann 1993; the treatment of images follows CIAO's `vtpdetect` help page.
Limits   cells end at the image border but not at unobserved pixels inside it: there they are too large and too faint.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from survey_mc.detect._vtp.circle_sweep import LongArray, order_by_distance
from survey_mc.detect._vtp.delaunay import triangulate
from survey_mc.detect._vtp.exact_predicates import COORDINATE_BITS
from survey_mc.detect._vtp.voronoi_cells import VoronoiCells, far_points, voronoi_cells
from survey_mc.types import BoolArray, FloatArray, Observation

MOST_PHOTONS = 2**22  # one cell each: a gigabyte and 10 s
Positions = Literal["pixel", "jitter", "photons"]


class PhotonCells(NamedTuple):
    """One row a distinct position, n in all: place (pixels), its pixel, photons, and its cell."""

    x_pix: FloatArray
    y_pix: FloatArray
    row: LongArray
    column: LongArray
    photons: LongArray
    voronoi: VoronoiCells


def photon_cells(
    observation: Observation, observed: BoolArray, positions: Positions, rng: np.random.Generator
) -> PhotonCells | None:
    """Cells of the photons in observed pixels; None if there are none."""
    height, width = observed.shape
    far_x, far_y = far_points(width, height)
    reach = int(max(np.ptp(far_x), np.ptp(far_y)))
    bits = COORDINATE_BITS - reach.bit_length()
    x, y, photons = distinct_positions(observation, observed, positions, rng, bits)
    if not len(x):
        return None
    unit = float(1 << bits)
    centre_x, centre_y = np.rint(x.mean()), np.rint(y.mean())
    order = order_by_distance(x, y, centre_x, centre_y)
    x, y = np.concatenate([x[order], far_x * unit]), np.concatenate([y[order], far_y * unit])
    mesh = triangulate(x, y, centre_x, centre_y)
    voronoi = voronoi_cells(x, y, len(order), mesh, observed, bits)
    x, y = x[:-4], y[:-4]
    column, row = nearest_pixels(x, bits, width), nearest_pixels(y, bits, height)
    return PhotonCells(x / unit, y / unit, row, column, photons[order], voronoi)


def nearest_pixels(place: FloatArray, bits: int, n_pix: int) -> LongArray:
    """Pixel of each place on the fine grid, along one axis."""
    return np.clip(np.floor(place / (1 << bits) + 0.5).astype(np.int64), 0, n_pix - 1)


def distinct_positions(
    observation: Observation, observed: BoolArray, positions: Positions, rng: np.random.Generator, bits: int
) -> tuple[FloatArray, FloatArray, LongArray]:
    """x, y in whole steps of the fine grid, and the photons at each, in the order of y, then x."""
    height, width = observed.shape
    middle = np.array([(width - 1) / 2.0, (height - 1) / 2.0])
    if positions == "photons":
        refuse_too_many(len(photon_list(observation)), positions)
        place = np.rint(photon_list(observation) * (1 << bits))
        seen = observed[nearest_pixels(place[:, 1], bits, height), nearest_pixels(place[:, 0], bits, width)]
        seen &= np.all(np.abs(place / (1 << bits) - middle) <= middle + 0.5, axis=1)  # on the image
        x, y = place[seen].astype(np.int64).T
    else:
        row, column = np.nonzero((observation.counts > 0) & observed)
        photons = observation.counts[row, column].astype(np.int64)
        x, y = column.astype(np.int64) << bits, row.astype(np.int64) << bits
        if positions == "pixel":
            return x.astype(np.float64), y.astype(np.float64), photons
        refuse_too_many(int(photons.sum()), positions)
        within = rng.integers(0, 1 << bits, (2, int(photons.sum())), dtype=np.int64) - (1 << (bits - 1))
        x, y = np.repeat(x, photons) + within[0], np.repeat(y, photons) + within[1]
    one = np.int64(1) << bits  # keeps the keys positive: no position lies further than a pixel outside
    key, multiplicity = np.unique(((y + one) << 32) | (x + one), return_counts=True)
    x, y = (key & 0xFFFFFFFF) - one, (key >> 32) - one
    return x.astype(np.float64), y.astype(np.float64), multiplicity.astype(np.int64)


def refuse_too_many(n_photons: int, positions: Positions) -> None:
    """ValueError if there are more photons than can have a cell each."""
    if n_photons > MOST_PHOTONS:
        raise ValueError(
            f'positions = "{positions}" takes at most {MOST_PHOTONS} photons; use "pixel" (got {n_photons})'
        )


def photon_list(observation: Observation) -> FloatArray:
    """(n, 2) photons; ValueError if the observation has only an image."""
    if observation.photons_pix is None:
        raise ValueError('positions = "photons" needs an observation with a photon list (got an image)')
    return observation.photons_pix
