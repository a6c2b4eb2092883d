"""What no single key can tell: do the sky, the instrument and the exposures of a campaign go together?

Idea     the sky of the first realisation is drawn in every band, so that a sky that does not fit the image or lacks a
         band is refused when the campaign is loaded and not field by field a night later. What would not fit into
         memory is refused before it is drawn.
Limits   a field whose first realisation is fine may still fail later; that is a failure in the journal.
"""

from __future__ import annotations

import math

import numpy as np

from survey_mc.campaign.cells import Cell, expand
from survey_mc.campaign.draw import cell_response, draw_truth
from survey_mc.campaign.inputs import located_params
from survey_mc.campaign.schema import Campaign
from survey_mc.detect import DETECTORS
from survey_mc.errors import BadInput, SurveyError
from survey_mc.fits.image import SCALE_RANGE_ARCSEC
from survey_mc.sky.clusters import ClustersParams
from survey_mc.sky.combined import CombinedParams
from survey_mc.sky.lognlogs import LogNLogSParams, expected_number
from survey_mc.telescope import InstrumentSettings

MAX_SOURCES = 1_000_000  # in one field: 100 MB of truth and a second to draw
MAX_ROWS_OF_FILE = 20_000_000  # of truth, 100 bytes each
MAX_LINKED = 10_000  # sources that a detection is linked with, 20 bytes each, for every detection
MAX_PHOTONS = 50_000_000  # in one field: 60 bytes each while they are drawn
JAMMING = 0.547  # covered fraction at which discs thrown at random no longer fit (Feder 1980, J. Theor. Biol. 87, 237)


def check_campaign(campaign: Campaign, where: str) -> None:
    """Raise `BadInput` for what can be known now of fields that cannot be drawn or searched; where: its name."""
    _check_sizes(campaign.instrument, where)
    deepest = {cell.band: cell for cell in sorted(expand(campaign), key=lambda cell: cell.exposure_ks)}
    for cell in deepest.values():
        try:
            with np.errstate(all="ignore"):
                _check_cell(campaign, cell)
        except SurveyError as problem:
            raise BadInput(where, str(problem).removeprefix(f"{where}: ")) from None
        _check_methods(campaign, cell_response(campaign, cell).grid.shape, where)


def _check_sizes(instrument: InstrumentSettings, where: str) -> None:
    """Pixels and PSFs have the sizes of telescopes: squares of the others leave the range of numbers."""
    least_arcsec = SCALE_RANGE_ARCSEC[0]
    sizes = {name: getattr(instrument, name) for name in ("scale_arcsec", "psf_fwhm_arcsec", "psf_hew_arcsec")}
    if instrument.believed_psf is not None:
        sizes["believed_psf.fwhm_arcsec"] = instrument.believed_psf.fwhm_arcsec
    for name, size_arcsec in sizes.items():
        if size_arcsec is not None and size_arcsec < least_arcsec:
            raise BadInput(where, f"instrument.{name}: must be at least {least_arcsec:g} (got {size_arcsec:g})")


def _check_methods(campaign: Campaign, shape: tuple[int, int], where: str) -> None:
    for number, choice in enumerate(campaign.method):
        check = DETECTORS[choice.name].check
        if getattr(choice.params, "background", None) == "granted" and not campaign.instrument.grants_background:
            raise BadInput(
                where,
                f'method[{number}].params.background: "granted" needs an instrument that grants its background map; '
                "set grants_background = true in [instrument]",
            )
        try:
            if check is not None:
                check(located_params(campaign, choice.params), shape)
        except (ValueError, SurveyError) as problem:
            raise BadInput(where, f"method[{number}].params: {problem}") from None


def _check_cell(campaign: Campaign, cell: Cell) -> None:
    response = cell_response(campaign, cell)
    parts = campaign.sky.parts if isinstance(campaign.sky, CombinedParams) else (campaign.sky,)
    n_sources = sum(
        expected_number(part, cell.band, response.half_width_arcsec)
        for part in parts
        if isinstance(part, LogNLogSParams)
    )
    if n_sources > MAX_SOURCES:
        raise BadInput(
            "sky.flux_min_cgs",
            f"gives {n_sources:.3g} sources in a field; at most {MAX_SOURCES:g} are allowed: a brighter flux_min_cgs, "
            "a smaller image, margin or normalisation",
        )
    _refuse_long_tables(campaign, n_sources, response.half_width_arcsec)
    for part in parts:
        _refuse_jammed(part)
    sky = draw_truth(campaign, cell, 0)
    rate_cps = float(sky.source_rows["rate_cps"].sum()) + sum(float(image.rate_cps.sum()) for image in sky.images)
    n_photons = rate_cps * response.exposure_s + float(response.background_edges[-1])
    if not n_photons <= MAX_PHOTONS:
        raise BadInput(
            "grid",
            f"cell {cell.label} has {n_photons:.3g} photons in a field; at most {MAX_PHOTONS:g} are allowed: a shorter "
            "exposure, fainter sources or less background",
        )


def _refuse_long_tables(campaign: Campaign, n_sources: float, half_width_arcsec: float) -> None:
    """A stored file is packed, and the links of a detection are made, in memory."""
    n_rows = n_sources * campaign.store.realisations_per_file
    if n_rows > MAX_ROWS_OF_FILE:
        raise BadInput(
            "store.realisations_per_file",
            f"gives {n_rows:.3g} sources in a stored file; at most {MAX_ROWS_OF_FILE:g} are allowed "
            f"(got {campaign.store.realisations_per_file} of {n_sources:.3g} sources)",
        )
    radius_arcsec = min(campaign.match.link_radius_arcsec, half_width_arcsec)
    n_linked = n_sources * math.pi * (radius_arcsec / (2.0 * half_width_arcsec)) ** 2
    if n_linked > MAX_LINKED:
        raise BadInput(
            "match.link_radius_arcsec",
            f"gives {n_linked:.3g} sources around each detection; at most {MAX_LINKED:g} are allowed "
            f"(got {campaign.match.link_radius_arcsec:g})",
        )


def _refuse_jammed(part: object) -> None:
    """Clusters that random throws cannot place would take seconds a field to find that out."""
    if not isinstance(part, ClustersParams) or part.positions_arcmin is not None:
        return
    half_arcmin = part.min_separation_arcmin / 2.0
    fits = JAMMING * (part.radius_arcmin + half_arcmin) ** 2
    if len(part.redshifts) * half_arcmin**2 > fits:
        raise BadInput(
            "sky.min_separation_arcmin",
            f"{len(part.redshifts)} clusters {part.min_separation_arcmin:g}′ apart do not fit a circle of "
            f"{part.radius_arcmin:g}′",
        )
