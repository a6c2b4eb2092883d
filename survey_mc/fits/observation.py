"""From files to an observation that a detector can work on.

Idea     what the files do not say is given by the user or left at a stated default, and every default leaves a note.
Limits   a binned file has no photon list: procedures that need one say so. The exposure map is taken as vignetted,
         as XMM-Newton and eROSITA make it; nothing is vignetted a second time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from survey_mc.errors import BadInput
from survey_mc.fits.header import MAX_EXPOSURE_S, ImageFacts
from survey_mc.fits.image import CountsImage, read_counts_image
from survey_mc.fits.maps import read_background_map, read_exposure_map
from survey_mc.types import Band, FloatImage, Observation, Psf

MAX_FRACTION_UNEXPOSED = 0.5  # more photons than this where nothing was exposed: the map is of another image
MAX_EXPOSURE_RATIO = 2.0  # map over header; beyond it the map was scaled (merged cameras) and the user is told
_BAND_NAMES = {(0.5, 2.0): "soft", (2.0, 10.0): "hard"}


@dataclass(frozen=True, slots=True)
class FileObservation:
    """observation: for the detectors; facts: of the image header; notes: what was assumed, one sentence each."""

    observation: Observation
    facts: ImageFacts
    notes: tuple[str, ...]


def observation_from_files(
    counts_path: str | Path,
    *,
    psf: Psf,
    exposure_path: str | Path | None = None,
    background_path: str | Path | None = None,
    counts_hdu: int | str | None = None,
    exposure_hdu: int | str | None = None,
    background_hdu: int | str | None = None,
    background_unit: str | None = None,
    pixel_scale_arcsec: float | None = None,
    axis_pix: tuple[float, float] | None = None,
    exposure_s: float | None = None,
    band: Band | None = None,
    flux_per_rate_cgs: float | None = None,
) -> FileObservation:
    """Read a counts image and its maps.

    Exposure: the map, else the header's EXPOSURE, LIVETIME or ONTIME, else exposure_s, else 1 s. band: else that of the
    header. flux_per_rate_cgs: erg/cm²/s of one on-axis ct/s; without it fluxes are NaN. Photons on pixels without
    exposure are dropped with a note. Raises `BadInput`.
    """
    _check_positive("exposure_s", exposure_s, MAX_EXPOSURE_S)
    _check_positive("flux_per_rate_cgs", flux_per_rate_cgs, math.inf)
    image = read_counts_image(counts_path, counts_hdu, pixel_scale_arcsec=pixel_scale_arcsec, axis_pix=axis_pix)
    notes = list(image.facts.notes)
    exposure_map_s = _exposure(image, exposure_path, exposure_hdu, exposure_s, notes)
    counts = _exposed_counts(image, exposure_map_s, str(exposure_path), notes)
    background = None
    if background_path is not None:
        background = read_background_map(background_path, image.grid, exposure_map_s, background_unit, background_hdu)
    chosen = band or _header_band(image.facts, flux_per_rate_cgs, notes)
    if band is not None and flux_per_rate_cgs is not None:
        chosen = Band(band.name, band.energy_min_kev, band.energy_max_kev, flux_per_rate_cgs)
    if chosen.flux_per_rate_cgs is None:
        notes.append("no conversion from count rate to flux was given: fluxes are NaN")
    observation = Observation(counts, None, exposure_map_s, background, psf, image.grid, chosen)
    return FileObservation(observation, image.facts, tuple(notes))


def _check_positive(name: str, value: float | None, largest: float) -> None:
    if value is not None and not (0.0 < value <= largest and value < math.inf):
        limit = f" of at most {largest:g}" if largest < math.inf else ""
        raise BadInput(name, f"must be a positive number{limit} (got {value})")


def _exposure(
    image: CountsImage, path: str | Path | None, hdu: int | str | None, given_s: float | None, notes: list[str]
) -> FloatImage:
    header_s = image.facts.exposure_s
    if given_s is not None and (path is not None or header_s is not None):
        stronger = "exposure map" if path is not None else f"exposure time of the header ({header_s:.6g} s)"
        notes.append(f"the given exposure time of {given_s:.6g} s is not used: the {stronger} is")
    if path is not None:
        exposure_s = read_exposure_map(path, image.grid.shape, image.grid.wcs, hdu)
        if header_s is not None and not 1.0 / MAX_EXPOSURE_RATIO < exposure_s.max() / header_s < MAX_EXPOSURE_RATIO:
            notes.append(
                f"the exposure map reaches {exposure_s.max():.6g} s but the image header says {header_s:.6g} s:"
                " the map seems to be scaled; rates and fluxes follow the map"
            )
        return exposure_s
    notes.append("no exposure map: every pixel counts as observed, without vignetting")
    time_s = header_s if header_s is not None else given_s
    if time_s is None:
        notes.append("no exposure time in the header and none given: 1 s is used, so rates are counts")
        time_s = 1.0
    return np.full(image.grid.shape, time_s, dtype=np.float64)


def _exposed_counts(image: CountsImage, exposure_s: FloatImage, where: str, notes: list[str]) -> np.ndarray:
    """Counts with those on pixels without exposure set to 0 (an observation has none there)."""
    outside = (exposure_s == 0.0) & (image.counts > 0)
    n_outside, n_all = int(image.counts[outside].sum()), int(image.counts.sum(dtype=np.int64))
    if n_outside == 0:
        return image.counts
    if n_outside > MAX_FRACTION_UNEXPOSED * n_all:
        raise BadInput(
            where, f"{n_outside} of the {n_all} photons lie where it has no exposure: it is of another image"
        )
    notes.append(f"{n_outside} of the {n_all} photons lie on pixels without exposure and are left out")
    return np.where(outside, np.int32(0), image.counts)


def _header_band(facts: ImageFacts, flux_per_rate_cgs: float | None, notes: list[str]) -> Band:
    low, high = facts.energy_min_kev, facts.energy_max_kev
    if low is None or high is None:
        notes.append("no energy band in the header and none given: the band is unknown")
        return Band("unknown", math.nan, math.nan, flux_per_rate_cgs)
    return Band(_BAND_NAMES.get((low, high), f"{low:g}-{high:g} keV"), low, high, flux_per_rate_cgs)
