"""From a filtered image to the rows of the detections table; the common end of the mixed procedures.

Idea     extract, measure, order, convert. Rows are ordered by decreasing significance, then y, then x.
Source   paper Sect. 3.4 (SExtractor photometry on the filtered image).
Limits   counts are what the Kron aperture holds; without aperture correction a point source loses its PSF wings.
         counts_err is √(photons in the aperture) of the raw image, where noise is not correlated; the uncertainty of
         the background level is not in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.columns import Column
from survey_mc.detect._sextractor import stellarity
from survey_mc.detect._sextractor.aperture_correction import aperture_fraction
from survey_mc.detect._sextractor.sep_chain import (
    FLAG_APERTURE_MASKED,
    FLAG_APERTURE_TRUNCATED,
    FLAG_KRON_CLIPPED,
    FLAG_NON_POSITIVE,
    Extraction,
    Float32Image,
    SepParams,
    extract,
)
from survey_mc.detect._shared.rows import COMMON_COLUMNS, Values, empty_frame, ordered_frame, rates_and_fluxes
from survey_mc.types import BoolArray, FloatArray, FloatImage, Observation

if TYPE_CHECKING:
    from pandas import DataFrame
N_ISOPHOTES = 8

SEP_COLUMNS = (
    Column("kron_radius", "float64", "Kron radius in units of the ellipse (a_pix, b_pix)", ucd="phys.angSize;src"),
    Column("aperture_pix", "float64", "radius of the circle as large as the Kron aperture", "pixel", "phys.angSize"),
    Column("a_pix", "float64", "rms length of the isophote along its major axis", "pixel", "phys.angSize.smajAxis"),
    Column("b_pix", "float64", "rms length of the isophote along its minor axis", "pixel", "phys.angSize.sminAxis"),
    Column("theta_deg", "float64", "major axis from +x towards +y", "deg", "pos.posAng"),
    Column("ellipticity", "float64", "1 − b/a", ucd="src.ellipticity"),
    Column("isoarea_pix", "int32", "pixels of the isophote", "pixel", "phys.area"),
    Column("iso_counts", "float64", "background-subtracted filtered counts in the isophote", "count", "phot.count"),
    Column("peak_per_pix", "float64", "highest background-subtracted filtered pixel", "count", "phot.count;stat.max"),
    Column("threshold_per_pix", "float64", "detection threshold above the background there", "count", "instr.det"),
    Column("sep_flag", "int32", "flag of the extraction as sep returns it", ucd="meta.code.qual"),
    *(
        Column(f"iso{i}_pix", "int32", f"pixels above threshold × (peak / threshold)^({i}/8)", "pixel", "phys.area")
        for i in range(N_ISOPHOTES)
    ),
    Column("stellarity", "float64", "neural index: 0 extended … 1 point", ucd="src.class.starGalaxy"),
)

# What SExtractor calls the same quantity in the same unit; KRON_RADIUS, ELLIPTICITY and FLAGS differ in capitals only.
SEXTRACTOR_NAMES = {
    "FLUX_AUTO": "counts",
    "FLUXERR_AUTO": "counts_err",
    "BACKGROUND": "background_per_pix",
    "A_IMAGE": "a_pix",
    "B_IMAGE": "b_pix",
    "THETA_IMAGE": "theta_deg",
    "ISOAREA_IMAGE": "isoarea_pix",
    "FLUX_ISO": "iso_counts",
    "FLUX_MAX": "peak_per_pix",
    "THRESHOLD": "threshold_per_pix",
    **{f"ISO{i}": f"iso{i}_pix" for i in range(N_ISOPHOTES)},
    "CLASS_STAR": "stellarity",
}

LEAST_RELATIVE_EXPOSURE = 1e-20  # below it a photon's brightness does not fit single precision


@dataclass(frozen=True, slots=True)
class Search:
    """A filtered image ready for extraction.

    filtered, background: counts per pixel, or counts at full exposure where relative_exposure is given. threshold:
    above the background. unit: what the peak is divided by to give the significance. masked: True = not observed.
    profile: linear core of the filter along one axis; core_sigma_pix: its standard deviation.
    """

    filtered: Float32Image
    background: Float32Image
    threshold: Float32Image
    unit: Float32Image
    masked: BoolArray
    profile: FloatArray
    core_sigma_pix: float
    relative_exposure: FloatImage | None = None


def catalogue(observation: Observation, search: Search, params: SepParams) -> DataFrame:
    """Extract and measure everything above the threshold of a search image."""
    signal = np.ascontiguousarray(search.filtered - search.background)
    found = extract(signal, search.threshold, search.masked, params)
    columns = COMMON_COLUMNS + SEP_COLUMNS
    if len(found.objects) == 0:
        return empty_frame(columns)
    values = isophotal_values(observation, search, signal, found)
    values |= photometry(observation, search, signal, found, values["exposure_s"], params)
    values |= classification(observation, search, signal, found, params)
    values["flags"] = found.objects["flag"] | values["flags"] | found.flags
    return ordered_frame(values | rates_and_fluxes(observation, values), columns)


def isophotal_values(observation: Observation, search: Search, signal: Float32Image, found: Extraction) -> Values:
    """Positions, shapes and peaks of the isophotes."""
    objects = found.objects
    x, y = np.asarray(objects["x"], dtype=np.float64), np.asarray(objects["y"], dtype=np.float64)
    peak = (objects["ypeak"], objects["xpeak"])
    exposure = observation.exposure_s[np.rint(y).astype(np.int64), np.rint(x).astype(np.int64)]
    # A barycentre may fall into a hole of the exposure map; the peak never does.
    exposure = np.where(exposure > 0.0, exposure, observation.exposure_s[peak])
    variance = barycentre_variances(search, signal, found)
    return {
        "x_pix": x,
        "y_pix": y,
        "x_err_pix": np.sqrt(variance[:, 0]),
        "y_err_pix": np.sqrt(variance[:, 1]),
        "exposure_s": exposure,
        "significance": np.asarray(objects["peak"], dtype=np.float64) / search.unit[peak],
        "a_pix": objects["a"],
        "b_pix": objects["b"],
        "theta_deg": np.degrees(objects["theta"]),
        "ellipticity": 1.0 - objects["b"] / objects["a"],
        "isoarea_pix": objects["npix"],
        "iso_counts": objects["flux"],
        "peak_per_pix": objects["peak"],
        "threshold_per_pix": search.threshold[peak],
        "sep_flag": objects["flag"],
    }


def classification(
    observation: Observation, search: Search, signal: Float32Image, found: Extraction, params: SepParams
) -> Values:
    """Isophotal areas and the stellarity index."""
    from survey_mc.detect._sextractor.isophotes import isophotal_areas  # numba: imported when it is first needed

    objects = found.objects
    peak = np.asarray(objects["peak"], dtype=np.float64)
    threshold = search.threshold[objects["ypeak"], objects["xpeak"]].astype(np.float64)
    segments = np.ascontiguousarray(found.segments, dtype=np.int32)
    areas_pix = isophotal_areas(segments, bounding_boxes(found), signal, peak, threshold)
    scale_arcsec = observation.grid.scale_arcsec
    index = stellarity.stellarity(
        areas_pix,
        peak / threshold,
        params.seeing(observation.psf, scale_arcsec),
        scale_arcsec,
        stellarity.open_network(params.stellarity_network),
    )
    return {f"iso{i}_pix": areas_pix[:, i] for i in range(N_ISOPHOTES)} | {"stellarity": index}


def bounding_boxes(found: Extraction) -> NDArray[np.int64]:
    """First and last column, first and last row (n, 4) of the objects, inclusive."""
    return np.stack([found.objects[name] for name in ("xmin", "xmax", "ymin", "ymax")], axis=1).astype(np.int64)


def barycentre_variances(search: Search, signal: Float32Image, found: Extraction) -> FloatArray:
    """Photon-noise variances (n, 2) of the barycentres, pix²."""
    from survey_mc.detect._sextractor.centroid_errors import (
        barycentre_variance,  # numba: imported when it is first needed
    )

    objects = found.objects
    centre = np.stack([objects["x"], objects["y"]], axis=1).astype(np.float64)
    expected = search.filtered
    if search.relative_exposure is not None:
        # The image is D/e: its variance per photon image pixel is (filtered · e) / e².
        seen = search.relative_exposure > LEAST_RELATIVE_EXPOSURE
        expected = np.divide(expected, search.relative_exposure, out=np.zeros(expected.shape), where=seen)
    variance: FloatArray = barycentre_variance(
        np.ascontiguousarray(found.segments, dtype=np.int32),
        bounding_boxes(found),
        centre,
        np.asarray(objects["flux"], dtype=np.float64),
        signal,
        search.threshold,
        np.ascontiguousarray(expected, dtype=np.float32),
        np.array(search.profile, dtype=np.float64),
    )
    return variance


def photometry(
    observation: Observation,
    search: Search,
    signal: Float32Image,
    found: Extraction,
    exposure_s: FloatArray,
    params: SepParams,
) -> Values:
    """Kron counts and half-light radii, with errors."""
    relative = np.ones((1, 1)) if search.relative_exposure is None else search.relative_exposure
    background = np.asarray(search.background * relative, dtype=np.float32)
    raw = observation.counts.astype(np.float32)
    on_raw = params.measure_on == "raw"
    values = aperture_values(signal, raw - background if on_raw else signal, raw, search.masked, found, params)
    scale_arcsec = observation.grid.scale_arcsec
    correction = np.ones(len(exposure_s))
    if params.aperture_correction == "psf_table":
        sigma_arcsec = 0.0 if on_raw else search.core_sigma_pix * scale_arcsec
        correction /= aperture_fraction(values["aperture_pix"] * scale_arcsec, observation.psf, sigma_arcsec)
    if search.relative_exposure is not None and not on_raw:
        correction *= exposure_s / observation.exposure_s.max()
    counts = values["counts"] * correction
    counts_err = values["counts_err"] * correction
    objects = found.objects
    return values | {
        "counts": counts,
        "counts_err": counts_err,
        "background_per_pix": background[np.rint(objects["y"]).astype(int), np.rint(objects["x"]).astype(int)],
        "r50_arcsec": values["r50_pix"] * scale_arcsec,
    }


def aperture_values(
    signal: Float32Image,
    measured: Float32Image,
    raw: Float32Image,
    masked: BoolArray,
    found: Extraction,
    params: SepParams,
) -> Values:
    """Kron radius (always of the filtered image), sums in the Kron aperture, half-light radius (pix), flag bits."""
    from survey_mc.detect._sextractor import photometry as kernels  # numba: imported when it is first needed

    objects = found.objects
    policy = {"ignore": kernels.IGNORE, "blank": kernels.BLANK, "mirror": kernels.MIRROR}[params.neighbours]
    centre = np.stack([objects["x"], objects["y"]], axis=1).astype(np.float64)
    shape = np.stack([objects[name] for name in ("cxx", "cyy", "cxy")], axis=1).astype(np.float64)
    major, minor = objects["a"].astype(np.float64), objects["b"].astype(np.float64)
    own = (np.ascontiguousarray(found.segments, dtype=np.int32), masked, centre, shape)
    radius = kernels.kron_radii(signal, *own, params.kron_integration, policy)
    least = params.kron_radius_min / params.kron_factor
    clipped = np.clip(np.nan_to_num(radius, nan=least), least, max(least, params.kron_integration))
    stretch = params.kron_factor * clipped
    total, photons, bits = kernels.ellipse_sums(measured, raw, *own, minor, stretch, policy)
    flags = np.where(clipped != radius, FLAG_KRON_CLIPPED, 0) | np.where(np.isnan(radius), FLAG_NON_POSITIVE, 0)
    flags |= np.where(bits & kernels.HAS_TRUNCATION, FLAG_APERTURE_TRUNCATED, 0)
    flags |= np.where(bits & kernels.HAS_BLOCKED, FLAG_APERTURE_MASKED, 0)
    r50_pix = kernels.half_light_radii(measured, *own[:3], major, total, params.kron_integration, policy)
    return {
        "counts": total,
        # At least one photon: an aperture that lost its photons to a mask still has an uncertainty.
        "counts_err": np.sqrt(np.maximum(photons, 1.0)),
        "kron_radius": clipped,
        "aperture_pix": stretch * np.sqrt(major * minor),
        "r50_pix": r50_pix,
        "flags": flags,
    }
