"""WAVDETECT: Mexican-hat transform over many scales, sources measured in cells of the PSF's size.

Idea     correlate the photons with wavelets of growing scale, keep local maxima above the threshold of a flat field,
         join them from small to large scales, and measure each source in the hill it stands on in a flux image smoothed
         at the scale nearest to the PSF.
Source   Freeman et al. 2002, ApJS 138, 185; Dobrzycki et al. 2000, CIAO Detect Manual (wtransform, wrecon); paper
         Sect. 3.3: tail 1e-4, scales 1 … 16 pixels in steps of √2. Differs: edges and gaps of the exposure
         (see `_wavdetect.transform`); the rule that joins scales (see `_wavdetect.scale_merging`); scales below 8
         pixels use the background of the ring of 8. Rows are ranked by SRC_SIGNIFICANCE, which sorts real from false
         better than MULTI_CORREL_MAX.
Weak at  false detections: 1e-4 a pixel and scale makes 30–35 in a blank field, 50–60 with exact thresholds; extended
         sources, of which the PSF-sized cell holds only the core or a fluctuation; faint sources beside bright ones,
         whose ring they stand in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from survey_mc.columns import Column
from survey_mc.detect._shared.convolution import Float32Image
from survey_mc.detect._shared.mexican_hat import mexican_hat
from survey_mc.detect._shared.observed import granted_background, observed_pixels
from survey_mc.detect._shared.rows import COMMON_COLUMNS, Values, detections_frame, empty_frame, nearest_pixel
from survey_mc.detect._wavdetect.background import Cleansing, scales_over_known_sky, scales_over_rings
from survey_mc.detect._wavdetect.params import LARGEST_TAIL, LEAST_TAIL, WavdetectParams
from survey_mc.detect._wavdetect.scale_merging import Maxima, Sources, merged_sources
from survey_mc.detect._wavdetect.source_measures import FluxImage, measured_cells, source_significance
from survey_mc.detect._wavdetect.thresholds import Thresholds
from survey_mc.detect._wavdetect.transform import Bank, ScaleImages, bank, significant_maxima
from survey_mc.detect.detector import Detector, ExtentStatistic
from survey_mc.types import BoolArray, FloatImage, Observation, Psf

if TYPE_CHECKING:
    from pandas import DataFrame
RING_AREA_PER_SIGMA2 = 25.1  # (ΣNW)²/ΣNW² = (4π/e)²/0.85, pixels whose counts a ring averages
FLOOR_PHOTONS = 1e-3  # cells are above this share of one photon's peak: rounding noise is below it
LEAST_CORRECTED_SHARE = 0.1
LEAST_PSF_PIX = 1e-3

FLAG_EDGE, FLAG_NEIGHBOUR, FLAG_ONE_SCALE, FLAG_NO_COUNTS, FLAG_UNCORRECTED = 1, 2, 4, 8, 16
FLAG_BITS = {
    FLAG_EDGE: "the cell touches the image border or unobserved pixels",
    FLAG_NEIGHBOUR: "the cell touches the cell of another source",
    FLAG_ONE_SCALE: "seen at one scale only",
    FLAG_NO_COUNTS: "the cell holds no more photons than background",
    FLAG_UNCORRECTED: "no aperture correction: the cell holds less than a tenth of the PSF",
}

WAVDETECT_COLUMNS = (
    Column("NPIXSOU", "int32", "pixels of the source cell", "pixel", "phys.area"),
    Column("BKG_COUNTS", "float64", "background counts in the cell", "count", "phot.count;instr.background"),
    Column("BKG_COUNTS_ERR", "float64", "1σ error of BKG_COUNTS", "count", "stat.error;phot.count"),
    Column("NET_RATE_ERR", "float64", "1σ error of rate_cps", "ct / s", "stat.error;phot.count"),
    Column("BKG_RATE", "float64", "background per pixel and second", "ct / (s pix)", "instr.background"),
    Column("MULTI_CORREL_MAX", "float64", "highest ratio of correlation to threshold over the scales", ucd="stat.snr"),
    Column("PSF_SIZE", "float64", "radius of the PSF's fraction psf_ecf", "pixel", "phys.angSize;instr.det.psf"),
    Column("X_ERR", "float64", "1σ error of x_pix from the spread of the cell's photons alone", "pixel", "stat.error"),
    Column("Y_ERR", "float64", "1σ error of y_pix from the spread of the cell's photons alone", "pixel", "stat.error"),
    Column(
        "R_1", "float64", "semi-major axis of the photons in the cell × ell_sigma", "pixel", "phys.angSize.smajAxis"
    ),
    Column(
        "R_2", "float64", "semi-minor axis of the photons in the cell × ell_sigma", "pixel", "phys.angSize.sminAxis"
    ),
    Column("ROTANG", "float64", "major axis from +x towards +y", "deg", "pos.posAng"),
    Column("PSFRATIO", "float64", "geometric mean of the 1σ semi-axes over PSF_SIZE", ucd="phys.angSize;arith.ratio"),
    Column(
        "correl_scale_pix", "float64", "wavelet scale of the highest ratio to the threshold", "pixel", "phys.angSize"
    ),
    Column("n_scales", "int32", "scales that see the source", ucd="meta.number"),
    Column("psf_fraction", "float64", "share of a point source's photons that fall into the cell", ucd="arith.ratio"),
)


@dataclass(frozen=True, slots=True)
class Search:
    """Maxima of every scale, ascending, and the images sources are measured on."""

    maxima: list[Maxima]
    image: FluxImage


def psf_size_pix(psf: Psf, fraction: float, scale_arcsec: float) -> float:
    """Radius (pix) that holds a fraction of the PSF."""
    radius_arcsec = np.concatenate([[0.0], np.geomspace(0.01, 3600.0, 2000)])
    return float(np.interp(fraction, psf.encircled_energy(radius_arcsec), radius_arcsec)) / scale_arcsec


def flux_scale(params: WavdetectParams, psf_pix: float) -> int:
    """Number of the scale nearest to the PSF's size, in the logarithm (paper Sect. 3.3)."""
    allowed = params.flux_scales_pix or params.scales_pix
    chosen = min(allowed, key=lambda sigma: abs(math.log(max(psf_pix, LEAST_PSF_PIX) / sigma)))
    return params.scales_pix.index(chosen)


def usable_photons(observation: Observation) -> tuple[Float32Image, Float32Image]:
    """Photons of the observed pixels, and exposure over its maximum."""
    observed = observed_pixels(observation)
    relative = observation.exposure_s / max(float(observation.exposure_s.max()), 1e-300)
    return (
        np.where(observed, observation.counts, 0).astype(np.float32),
        np.ascontiguousarray(relative, dtype=np.float32),
    )


def search(observation: Observation, params: WavdetectParams) -> Search:
    """Transform at every scale, background, significant maxima, flux image. Something must be observed."""
    photons, relative = usable_photons(observation)
    observed = relative > 0.0
    analysed = observed & (relative >= params.exp_thresh)
    kernels = bank(photons.shape, params.scales_pix)
    light = kernels.convolver.image(photons)
    tail = params.sigthresh
    if params.false_per_scale is not None:
        tail = min(max(params.false_per_scale / max(int(analysed.sum()), 1), LEAST_TAIL), LARGEST_TAIL)
    tails = (tail, params.bkg_sig_thresh)
    thresholds = [Thresholds(params.threshold, sigma, tails, 2.0 * params.photons_min) for sigma in params.scales_pix]
    if params.background == "granted":
        background = np.where(observed, granted_background(observation), 0.0).astype(np.float32)
        images = scales_over_known_sky(background, observed, light, kernels)
        area_pix = math.inf
    else:
        borrowed = [sigma < params.background_min_scale_pix for sigma in params.scales_pix]
        first_ring = min(sum(borrowed), len(borrowed) - 1)
        cleansing = Cleansing(params.bkg_sig_thresh, params.max_iter, params.iter_stop)
        images, background = scales_over_rings(photons, relative, light, kernels, thresholds, first_ring, cleansing)
        area_pix = min(RING_AREA_PER_SIGMA2 * params.scales_pix[-1] ** 2, float(observed.sum()))
    maxima = [scale_maxima(i, t, tail, observed, analysed) for i, t in zip(images, thresholds, strict=True)]
    core = flux_scale(params, psf_size_pix(observation.psf, params.psf_ecf, observation.grid.scale_arcsec))
    flux = smoothed_by_core(photons - background, kernels, core)
    flux[~observed] = -np.inf
    floor = FLOOR_PHOTONS * core_peak(params.scales_pix[core])
    return Search(maxima, FluxImage(flux, floor, params.scales_pix[core], photons, background, area_pix))


def scale_maxima(
    images: ScaleImages, thresholds: Thresholds, tail: float, observed: BoolArray, analysed: BoolArray
) -> Maxima:
    """Local maxima of the correlation above the threshold, in analysed pixels."""
    pixels, ratio = significant_maxima(images, thresholds, tail, observed)
    kept = analysed.ravel()[pixels]
    row, column = np.divmod(pixels[kept], observed.shape[1])
    return Maxima(images.sigma_pix, row, column, ratio[kept])


def smoothed_by_core(image: Float32Image, kernels: Bank, i: int) -> Float32Image:
    """Image smoothed by the positive core PW of a scale, of unit sum."""
    core = kernels.wavelets[i] + kernels.ring(i)
    return kernels.convolver.apply(kernels.convolver.image(image), core / core[0, 0])


def core_peak(sigma_pix: float) -> float:
    """What one photon adds to its own pixel of the flux image."""
    hat = mexican_hat(sigma_pix)
    return float(hat.max() / np.maximum(hat, 0.0).sum())


def detect(observation: Observation, params: WavdetectParams, rng: np.random.Generator) -> DataFrame:
    """Detections of WAVDETECT; deterministic, the generator is not used."""
    from survey_mc.detect._wavdetect.source_cells import hill_tops

    observed = observed_pixels(observation)
    columns = COMMON_COLUMNS + WAVDETECT_COLUMNS
    if not observed.any() or not observation.counts[observed].any():
        return empty_frame(columns)
    found = search(observation, params)
    scale_arcsec = observation.grid.scale_arcsec
    psf_pix = psf_size_pix(observation.psf, params.psf_ecf, scale_arcsec)
    top = hill_tops(found.image.flux)
    sources = merged_sources(found.maxima, top, found.image.flux, found.image.floor, psf_pix)
    if len(sources.cell) == 0:
        return empty_frame(columns)
    cells = measured_cells(found.image, top, sources.cell, observation.psf, scale_arcsec, params.centroid == "net")
    values = source_values(observation, params, psf_pix, sources, cells)
    return detections_frame(observation, values, WAVDETECT_COLUMNS)


def source_values(
    observation: Observation, params: WavdetectParams, psf_pix: float, sources: Sources, cells: Values
) -> Values:
    """Columns of the detections from the measurements of the cells."""
    flags = np.where(cells["at_edge"], FLAG_EDGE, 0)
    flags |= np.where(cells["at_neighbour"], FLAG_NEIGHBOUR, 0)
    flags |= np.where(sources.n_scales == 1, FLAG_ONE_SCALE, 0) | np.where(cells["counts"] <= 0.0, FLAG_NO_COUNTS, 0)
    correction = np.ones(len(flags))
    if params.aperture_correction == "psf_cell":
        enough = cells["psf_share"] >= LEAST_CORRECTED_SHARE
        correction = np.where(enough, 1.0 / np.where(enough, cells["psf_share"], 1.0), 1.0)
        flags |= np.where(enough, 0, FLAG_UNCORRECTED)
    exposure_s = observation.exposure_s[nearest_pixel(observation, cells["x_pix"], cells["y_pix"])]
    per_second = np.divide(1.0, exposure_s, out=np.zeros(len(flags)), where=exposure_s > 0.0)
    counts_err = cells["counts_err"] * correction
    return {
        **{
            name: cells[name]
            for name in ("x_pix", "y_pix", "x_err_pix", "y_err_pix", "background_per_pix", "r50_arcsec")
        },
        "counts": cells["counts"] * correction,
        "counts_err": counts_err,
        "significance": source_significance(cells["counts"], cells["background_counts"]),
        "flags": flags,
        "NPIXSOU": cells["n_pix"],
        "BKG_COUNTS": cells["background_counts"],
        "BKG_COUNTS_ERR": cells["background_counts_err"],
        "NET_RATE_ERR": counts_err * per_second,
        "BKG_RATE": cells["background_per_pix"] * per_second,
        "MULTI_CORREL_MAX": sources.ratio,
        "PSF_SIZE": np.full(len(flags), psf_pix),
        "X_ERR": cells["x_err_photons"],
        "Y_ERR": cells["y_err_photons"],
        "R_1": params.ell_sigma * cells["major_pix"],
        "R_2": params.ell_sigma * cells["minor_pix"],
        "ROTANG": cells["angle_deg"],
        "PSFRATIO": np.sqrt(cells["major_pix"] * cells["minor_pix"]) / max(psf_pix, LEAST_PSF_PIX),
        "correl_scale_pix": sources.sigma_pix,
        "n_scales": sources.n_scales,
        "psf_fraction": cells["psf_share"],
    }


def view(observation: Observation, params: WavdetectParams) -> FloatImage:
    """Photons smoothed by the wavelet core of the PSF's size: the image the cells are cut from, background included."""
    photons, _relative = usable_photons(observation)
    core = flux_scale(params, psf_size_pix(observation.psf, params.psf_ecf, observation.grid.scale_arcsec))
    return smoothed_by_core(photons, bank(photons.shape, params.scales_pix), core).astype(np.float64)


PAPER = WavdetectParams()
MODERN = WavdetectParams(threshold="exact", false_per_scale=1.0, aperture_correction="psf_cell")

DETECTOR = Detector(
    name="wavdetect",
    label="WAVDETECT",
    version=1,
    about="Mexican-hat wavelets over many scales, background from their rings, counts in PSF-sized source cells",
    reference="Freeman et al. 2002; Valtchanov, Pierre & Gastaud 2001, Sect. 3.3",
    params=WavdetectParams,
    detect=detect,
    tiny=PAPER,
    extra_columns=WAVDETECT_COLUMNS,
    view=view,
    profiles={"paper": PAPER, "modern": MODERN},
    flag_bits=FLAG_BITS,
    native_names={
        "NET_COUNTS": "counts",
        "NET_COUNTS_ERR": "counts_err",
        "NET_RATE": "rate_cps",
        "EXPTIME": "exposure_s",
        "SRC_SIGNIFICANCE": "significance",
    },
    extent_statistics=(
        ExtentStatistic("PSFRATIO", "size over PSF size", 1.0, "Valtchanov, Pierre & Gastaud 2001, Sect. 5.4: unity"),
    ),
)
