"""Sliding cell: photons in a box against what its surroundings or a background map let expect.

Idea     LIKE = −ln P(n ≥ box counts | expected background) of an n × n box at every pixel; its local maxima are the
         candidates. Repeated on the image binned by 2, 4 (and 8), which finds what is wider than the box. Local mode
         takes the background from a frame of (n + 4)² − n² pixels, map mode from a map.
Source   SAS task eboxdetect (Watson et al. 2009, A&A 493, 339, Sect. 4.4).
         Differs: where a mask cuts the frame it is widened; a candidate of a binned run replaces the finer ones in its
         box if its LIKE is more than their sum, else they stand for it (the task's merging is not documented); the
         mean position of the photons is freed of background and truncation, and has the error of a mean.
Limits   binned runs count a source as if all of it were in the box. Local mode takes the frame's mean as exact, so it
         finds far more by chance than LIKE says. Pairs closer than the box are one candidate; bright extended sources
         and the wings of bright points are several.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator
from scipy.special import gammaincinv

from survey_mc.caches import bounded_cache
from survey_mc.detect._eml.sliding_cell_measures import (
    Images,
    Run,
    moved_from_gaps,
    net_counts,
    positions,
    psf_fractions,
    psf_stamp,
    windows,
)
from survey_mc.detect._shared.observed import observed_pixels
from survey_mc.detect.detector import DetectorParams
from survey_mc.types import FloatArray, FloatImage, Observation

LARGEST_TABLED_COUNTS = 4096  # beyond it every excess is looked at exactly
TABLE_ROUNDING = 1e-9  # by which the table lets more pass
WIDEST_FRAME_PIX = 8  # of the binned image, where a mask cuts the frame
N_VALUES, X, Y, LIKE, BOX_SIZE = 11, 0, 1, 4, 9  # columns of a table of candidates: the fields of Cells


class SlidingCellParams(DetectorParams):
    """Parameters of the sliding cell, in both modes."""

    box_pix: int = Field(5, ge=3, le=15, description="side of the detection box (pixels of the binned image), odd")
    n_runs: int = Field(3, ge=1, le=4, description="number of runs; the image is binned by 1, 2, 4, 8")
    like_min_local: float = Field(
        8.0, ge=1.0, le=500.0, description="least −ln P of a local-mode candidate, which the background map leaves out"
    )
    like_min_map: float = Field(
        6.6, ge=1.0, le=500.0, description="least −ln P of a map-mode candidate; 6.6 is the paper's ~3σ"
    )
    cell_step: Literal["binned_pixel", "pixel"] = Field(
        "binned_pixel",
        description="binned runs move by a binned pixel (as published) or by a pixel (independent of the pixel grid)",
    )

    @field_validator("box_pix")
    @classmethod
    def _odd_box(cls, box_pix: int) -> int:
        if box_pix % 2 == 0:
            raise ValueError(f"box_pix must be odd (got {box_pix})")
        return box_pix


@dataclass(frozen=True, slots=True)
class Cells:
    """Candidates by decreasing likelihood; arrays (n,).

    like: −ln P. counts: PSF-complete net counts (of the box alone in binned runs), for the exposure at the source.
    box_counts: photons in the box. background_per_pix: at the source (counts per pixel). box_size_pix: side of the box
    in image pixels. box_area_pix: its area in pixels with the background of the source's. box_id: 1 … n.
    """

    x_pix: FloatArray
    y_pix: FloatArray
    x_err_pix: FloatArray
    y_err_pix: FloatArray
    like: FloatArray
    counts: FloatArray
    counts_err: FloatArray
    box_counts: FloatArray
    background_per_pix: FloatArray
    box_size_pix: FloatArray
    box_area_pix: FloatArray
    box_id: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.x_pix)


@bounded_cache(32)
def largest_means(like_min: float) -> FloatArray:
    """The largest mean for which k counts reach like_min, k = 0 … LARGEST_TABLED_COUNTS; read-only."""
    means = np.zeros(LARGEST_TABLED_COUNTS + 1)
    k = np.arange(1.0, LARGEST_TABLED_COUNTS + 1.0)
    means[1:] = gammaincinv(k, math.exp(-like_min)) * (1.0 + TABLE_ROUNDING)
    means.setflags(write=False)
    return means


def images_of(observation: Observation, background: FloatImage | None, margin: int) -> Images:
    """Integral images with a margin as wide as the widest frame."""
    from survey_mc.detect._eml.sliding_cell_kernels import integral_image

    counts = np.ascontiguousarray(observation.counts, dtype=np.float64)
    exposure = np.ascontiguousarray(observation.exposure_s, dtype=np.float64)
    weight = exposure if background is None else np.ascontiguousarray(background, dtype=np.float64)
    sums = np.zeros((2, *(n + 2 * margin + 1 for n in counts.shape)))
    integral_image(counts, exposure, margin, sums[0])
    integral_image(weight, exposure, margin, sums[1])
    return Images(counts, exposure, weight, sums, margin, background is None)


def run_cells(images: Images, run: Run, like_min: float, stamp: FloatImage) -> FloatArray:
    """(n, N_VALUES) candidates of one run."""
    from survey_mc.detect._eml import sliding_cell_kernels as kernels

    side, factor, step, half = run.side, run.factor, run.step, (run.side - run.factor) // 2
    n_rows, n_columns = (
        max((n - factor) // step + 1, 1) if step < factor else -(-n // step) for n in images.counts.shape
    )
    like = np.zeros((n_rows, n_columns))
    found, values = kernels.cell_likelihoods(
        images.sums, images.margin, side, factor, step, images.local, largest_means(like_min), like
    )
    y, x = found // n_columns * step, found % n_columns * step
    seen = windows(images.exposure, y, x, factor).reshape(len(y), factor**2).max(axis=1) > 0.0
    like.ravel()[found[~seen]] = 0.0
    best = np.flatnonzero(seen)
    best = best[kernels.local_maxima(like, found[best], images.counts, images.exposure, side, factor, step)]
    y, x, values = y[best], x[best], values[best]
    n, x_pix, y_pix, x_err, y_err = positions(images, (y - half, x - half), values[:, kernels.MEAN], run, stamp)
    x_pix, y_pix = moved_from_gaps(images, x_pix, y_pix, y, x, factor)
    source = (np.floor(y_pix + 0.5).astype(np.int64), np.floor(x_pix + 0.5).astype(np.int64))
    box, frame = np.ones(len(y)), np.zeros(len(y))
    if factor == 1:
        at_source = images.exposure[source]
        box = psf_fractions(images, y, x, half, np.zeros(len(y)), stamp) / at_source
        if images.local:
            frame = psf_fractions(images, y, x, half, values[:, kernels.FRAME_WIDTH], stamp) / at_source - box
    net, net_err, background, area = net_counts(images.local, values, n, (box, frame), images.weight[source])
    like_of, sides = like.ravel()[found[best]], np.full(len(y), float(side))
    return np.stack([x_pix, y_pix, x_err, y_err, like_of, net, net_err, n, background, sides, area], axis=1)


def merge(finer: FloatArray, coarser: FloatArray) -> FloatArray:
    """Candidates of one run more.

    A candidate that is likelier than the finer ones in its box taken together replaces them; else they explain it.
    """
    if not len(coarser):
        return finer
    reach = 0.5 * coarser[0, BOX_SIZE]
    near = np.abs(coarser[:, None, X] - finer[None, :, X]) <= reach
    near &= np.abs(coarser[:, None, Y] - finer[None, :, Y]) <= reach
    stays = coarser[:, LIKE] > near @ finer[:, LIKE]
    return np.concatenate([finer[~near[stays].any(axis=0)], coarser[stays]])


def sliding_cell(observation: Observation, background: FloatImage | None, params: SlidingCellParams) -> Cells:
    """Candidates of all runs, merged.

    background: expected counts per pixel, for map mode; None for local mode. Nothing observed gives no cells.
    """
    table = np.zeros((0, N_VALUES))
    if observed_pixels(observation).any():
        half, coarsest = params.box_pix // 2, 2 ** (params.n_runs - 1)
        like_min = params.like_min_local if background is None else params.like_min_map
        images = images_of(observation, background, (half + WIDEST_FRAME_PIX + 1) * coarsest)
        stamp = psf_stamp(observation.psf, observation.grid.scale_arcsec, half + WIDEST_FRAME_PIX)
        for factor in (2**number for number in range(params.n_runs)):
            run = Run(params.box_pix * factor, factor, factor if params.cell_step == "binned_pixel" else 1)
            table = merge(table, run_cells(images, run, like_min, stamp))
    order = np.lexsort((table[:, X], table[:, Y], -table[:, LIKE]))
    x, y, x_err, y_err, like, counts, counts_err, box_counts, background, side, area = np.ascontiguousarray(
        table[order].T
    )
    box_id = np.arange(1, len(table) + 1)
    return Cells(x, y, x_err, y_err, like, counts, counts_err, box_counts, background, side, area, box_id)
