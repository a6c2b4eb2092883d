"""What no single key can tell: do the sky, the instrument and the exposures of a campaign go together?

Idea     the sky of the first realisation is drawn in every band, so that a sky that does not fit the image or lacks a
         band is refused when the campaign is loaded and not field by field a night later. What would not fit into
         memory is refused before it is drawn.
Limits   a field whose first realisation is fine may still fail later; that is a failure in the journal.
"""

from __future__ import annotations

import numpy as np

from survey_mc.campaign.cells import Cell, expand
from survey_mc.campaign.draw import cell_response, draw_truth
from survey_mc.campaign.inputs import located_params
from survey_mc.campaign.schema import Campaign
from survey_mc.detect import DETECTORS
from survey_mc.errors import BadInput, SurveyError
from survey_mc.sky.combined import CombinedParams
from survey_mc.sky.lognlogs import LogNLogSParams, expected_number

MAX_SOURCES = 1_000_000  # in one field: 100 MB of truth and a second to draw
MAX_PHOTONS = 50_000_000  # in one field: 60 bytes each while they are drawn


def check_campaign(campaign: Campaign, where: str) -> None:
    """Raise `BadInput` for what can be known now of fields that cannot be drawn or searched; where: its name."""
    deepest = {cell.band: cell for cell in sorted(expand(campaign), key=lambda cell: cell.exposure_ks)}
    for cell in deepest.values():
        try:
            with np.errstate(all="ignore"):
                _check_cell(campaign, cell)
        except SurveyError as problem:
            raise BadInput(where, str(problem).removeprefix(f"{where}: ")) from None
        _check_methods(campaign, cell_response(campaign, cell).grid.shape, where)


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
    sky = draw_truth(campaign, cell, 0)
    rate_cps = float(sky.sources["rate_cps"].sum()) + sum(float(image.rate_cps.sum()) for image in sky.images)
    n_photons = rate_cps * response.exposure_s + float(response.background_edges[-1])
    if not n_photons <= MAX_PHOTONS:
        raise BadInput(
            f"cell {cell.label}",
            f"has {n_photons:.3g} photons in a field; at most {MAX_PHOTONS:g} are allowed: a shorter exposure, fainter "
            "sources or less background",
        )
