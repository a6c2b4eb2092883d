"""VTPDETECT: Voronoi tessellation and percolation of the photons.

Idea     every photon owns a Voronoi cell, whose inverse area is the surface brightness there. Cells brighter than
         the Poisson law of cell areas allows are joined with their bright neighbours, and a group with more photons
         than the background makes is a source, of whatever shape. No point spread function is needed.
Source   paper Sect. 3.2; Ebeling & Wiedenmann 1993; steps and defaults of the CIAO 4 help page of `vtpdetect`.
         Differs: the unit of flux is the mean density with bright cells clipped, not that of all photons; the exposure
         is used; cells that only meet in a point are no neighbours and cells of one flux are deleted together, so that
         a turned image gives the same sources; the "super Voronoi cell" option, off by default, is left out. Whether
         all counts or the net counts are tested is open: all of them make as many false detections as the paper has.
Weak at  neighbours, which the wings of the point spread function join (30″ pairs are one source); irregular groups,
         whose centres are off; photons in pixel centres once most pixels are occupied (100 ks), when the areas are all
         alike and the cut-off has no meaning; a background that is not flat, unless the exposure is used.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.ndimage import minimum_filter

from survey_mc.detect._shared.observed import granted_background, observed_pixels
from survey_mc.detect._shared.rows import COMMON_COLUMNS, Values, detections_frame, empty_frame
from survey_mc.detect._vtp import cell_groups
from survey_mc.detect._vtp.params import VTP_COLUMNS, VtpDetectParams
from survey_mc.detect._vtp.poisson_voronoi import fit_faint_cells, flat_density, flux_cutoff
from survey_mc.detect.detector import R50, Detector
from survey_mc.types import BoolArray, FloatArray, FloatImage, Observation, Skip

if TYPE_CHECKING:
    from pandas import DataFrame

    from survey_mc.detect._vtp.photon_cells import PhotonCells

AT_EDGE, TRIMMED, FEW_POSITIONS = 1, 2, 4
FLAG_BITS = {
    AT_EDGE: "the group reaches the cells left out at the border or at unobserved pixels: it may go on there",
    TRIMMED: "the faintest cells were deleted until the group was significant",
    FEW_POSITIONS: "fewer than three distinct photon positions: the ellipse rests on the pixel size",
}
FEWEST_POSITIONS = 3
LEAST_BACKGROUND_PER_PIX = 1e-6  # counts; keeps fluxes and logarithms finite where nothing is expected


class Percolated(NamedTuple):
    """label: group of each cell, −1 for none; trimmed: of each group; expected: background counts of each cell;
    flux: of each cell in units of the background; cutoff: the last one."""

    label: cell_groups.LabelArray
    trimmed: BoolArray
    expected: FloatArray
    flux: FloatArray
    cutoff: float


def detect(observation: Observation, params: VtpDetectParams, rng: np.random.Generator) -> DataFrame | Skip:
    """Detections of VTPDETECT; the generator is used by positions = "jitter" only."""
    from survey_mc.detect._vtp.photon_cells import photon_cells  # numba: imported when it is first needed

    if params.positions == "photons" and observation.photons_pix is None:
        return Skip('positions = "photons" needs the photon list, and the observation has only an image')
    observed = observed_pixels(observation)
    cells = photon_cells(observation, observed, params.positions, rng) if observed.any() else None
    if cells is None:
        return empty_frame(COMMON_COLUMNS + VTP_COLUMNS)
    width = 2 * params.edge_pix + 1
    inner = minimum_filter(observed.astype(np.uint8), width, mode="constant") > 0
    found = percolated(cells, observation, inner, params)
    if not (found.label >= 0).any():
        return empty_frame(COMMON_COLUMNS + VTP_COLUMNS)
    return detections_frame(observation, group_values(cells, found, inner, observation, params), VTP_COLUMNS)


def percolated(cells: PhotonCells, observation: Observation, inner: BoolArray, params: VtpDetectParams) -> Percolated:
    """Background, cut-off and groups, iterated until the groups no longer change."""
    from survey_mc.detect._vtp.percolation import groups

    photons = cells.photons.astype(np.float64)
    usable = inner[cells.row, cells.column]
    weight, number = background_shape(cells, observation, inner, params)
    source = np.zeros(len(photons), dtype=np.bool_)
    found = Percolated(np.full(len(photons), -1, np.int32), source[:0], photons, photons, params.max_cutoff)
    area = cells.voronoi.area_pix * weight
    typical = usable & cells.voronoi.whole
    if not typical.any():
        typical = np.ones(len(photons), dtype=np.bool_)
    unit, level = 1.0, 1.0
    if params.background == "fit":
        unit = flat_density(photons[typical], area[typical], params.voronoi_k)
    flux = photons / (area * unit)
    for _ in range(params.max_iter):
        if params.background == "fit":
            level, number = fit_faint_cells(
                flux[typical & ~source],
                params.voronoi_k,
                params.max_bkg_flux,
                params.fit_start,
                params.fit_tolerance,
            )
        search = (params.min_tot_flux, params.max_tot_flux)
        cutoff = flux_cutoff(flux[typical], params.voronoi_k, level, number, search)
        cutoff = params.scale * min(max(cutoff, params.min_cutoff), params.max_cutoff)
        bright = usable & (flux > cutoff)
        expected = area * (unit * level)
        label, trimmed = cell_groups.significant_groups(
            groups(cells.voronoi.neighbours, bright),
            photons,
            expected,
            flux,
            params.limit,
            params.coarse,
            params.tested_counts,
        )
        found = Percolated(label, trimmed, expected, flux, cutoff)
        if np.array_equal(source, label >= 0):
            break
        source = label >= 0
    return found


def background_shape(
    cells: PhotonCells, observation: Observation, inner: BoolArray, params: VtpDetectParams
) -> tuple[FloatArray, float]:
    """Relative background at each cell, and the number of background cells if it is known.

    granted: counts per pixel, and how many positions they occupy; fit: the relative exposure if it is used, else 1.
    """
    if params.background == "granted":
        granted = np.maximum(granted_background(observation), LEAST_BACKGROUND_PER_PIX)
        occupied = -np.expm1(-granted) if params.positions == "pixel" else granted
        return granted[cells.row, cells.column], float(occupied[inner].sum())
    if not params.use_exposure:
        return np.ones(len(cells.photons)), 0.0
    exposure = observation.exposure_s
    return exposure[cells.row, cells.column] / exposure.max(), 0.0


def group_values(
    cells: PhotonCells, found: Percolated, inner: BoolArray, observation: Observation, params: VtpDetectParams
) -> Values:
    """Properties of the groups, one row each."""
    member = found.label >= 0
    label, expected, flux = found.label[member], found.expected[member], found.flux[member]
    photons, area_pix = cells.photons[member].astype(np.float64), cells.voronoi.area_pix[member]
    x_pix, y_pix = cells.x_pix[member], cells.y_pix[member]
    net = np.maximum(photons - expected, 0.0)
    counts, background, area, n_cells = (
        cell_groups.group_sums(label, v) for v in (photons, expected, area_pix, np.ones(len(label)))
    )
    # A jittered photon carries the width of its pixel in its position already.
    variance = cell_groups.PIXEL_VARIANCE if params.positions == "pixel" else 0.0
    weight = net if params.centroid == "counts" else flux
    place = cell_groups.moments(label, x_pix, y_pix, weight, photons, variance)
    distance_pix = np.hypot(x_pix - place["x"][label], y_pix - place["y"][label])
    # No radius is known better than a pixel, unless the photons are.
    least_pix = 0.0 if params.positions == "photons" else math.sqrt(2.0 * cell_groups.PIXEL_VARIANCE)
    r50_pix = np.maximum(cell_groups.half_counts_radius(label, distance_pix, net), least_pix)
    long_axis, short_axis, angle = cell_groups.ellipse(place["xx"], place["yy"], place["xy"])
    return {
        "x_pix": place["x"],
        "y_pix": place["y"],
        "x_err_pix": place["x_err"],
        "y_err_pix": place["y_err"],
        "counts": counts - background,
        "counts_err": np.sqrt(counts),
        "background_per_pix": background / area,
        "significance": cell_groups.minus_log_tail(counts, background),
        "r50_arcsec": r50_pix * observation.grid.scale_arcsec,
        "flags": AT_EDGE * at_edge(cells, found.label, inner)
        + TRIMMED * found.trimmed
        + FEW_POSITIONS * (n_cells < FEWEST_POSITIONS),
        "BKG_COUNTS": background,
        "NPIXSOU": area,
        "N_CELLS": n_cells,
        "R_1": params.ell_sigma * long_axis,
        "R_2": params.ell_sigma * short_axis,
        "ROTANG": angle,
        "CUTOFF": np.full(len(counts), found.cutoff),
    }


def at_edge(cells: PhotonCells, label: cell_groups.LabelArray, inner: BoolArray) -> BoolArray:
    """(n_groups,) True where a cell of the group is not whole, or next to one that was left out."""
    left_out = ~inner[cells.row, cells.column]
    pairs = cells.voronoi.neighbours
    cut_short = ~(cells.voronoi.whole & cells.voronoi.inside)
    cut_short[pairs[left_out[pairs[:, 0]], 1]] = True
    cut_short[pairs[left_out[pairs[:, 1]], 0]] = True
    return cell_groups.group_sums(label, cut_short.astype(np.float64)) > 0.0


def density_image(observation: Observation, params: VtpDetectParams) -> FloatImage:
    """Photons per pixel² of the Voronoi cell each pixel's centre lies in; 0 where not observed."""
    from scipy.spatial import cKDTree

    from survey_mc.detect._vtp.photon_cells import photon_cells

    observed = observed_pixels(observation)
    positions = "jitter" if params.positions == "photons" and observation.photons_pix is None else params.positions
    cells = photon_cells(observation, observed, positions, np.random.default_rng(0)) if observed.any() else None
    image = np.zeros(observed.shape)
    if cells is None:
        return image
    row, column = np.nonzero(observed)
    nearest = cKDTree(np.stack([cells.x_pix, cells.y_pix], axis=1)).query(np.stack([column, row], axis=1))[1]
    image[row, column] = (cells.photons / cells.voronoi.area_pix)[nearest]
    return image


PAPER = VtpDetectParams()
# The groups are chosen for their photons, so the net counts are the safer test; their outskirts are accidental, so the
# flux is the better weight; cells are cut at the border, so none need be left out there.
MODERN = VtpDetectParams(positions="jitter", voronoi_k=3.5, tested_counts="net", centroid="flux", edge_pix=0)

DETECTOR = Detector(
    name="vtpdetect",
    label="VTPDETECT",
    version=1,
    about="Voronoi tessellation of the photons and percolation of the cells above the background",
    reference="Valtchanov, Pierre & Gastaud 2001, Sect. 3.2; Ebeling & Wiedenmann 1993",
    params=VtpDetectParams,
    detect=detect,
    tiny=PAPER,
    extra_columns=VTP_COLUMNS,
    view=density_image,
    profiles={"paper": PAPER, "modern": MODERN},
    flag_bits=FLAG_BITS,
    native_names={"NET_COUNTS": "counts", "NET_COUNTS_ERR": "counts_err", "NET_RATE": "rate_cps"},
    extent_statistics=(R50,),
)
