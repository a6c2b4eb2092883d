"""Any field of a campaign, drawn from its keys alone: the same photons wherever and whenever it is asked for."""

from __future__ import annotations

from functools import partial

from survey_mc.campaign.cells import Cell
from survey_mc.campaign.inputs import sky_images
from survey_mc.campaign.keys import realisation_key
from survey_mc.campaign.schema import Campaign
from survey_mc.rng import stream
from survey_mc.sky import SkyContext, draw_sky
from survey_mc.telescope.response import Response, build_response
from survey_mc.types import Field, Sky


def cell_response(campaign: Campaign, cell: Cell) -> Response:
    """The instrument of a cell: its band, exposure, PSF, vignetting and background."""
    return build_response(campaign.instrument, cell.band, cell.exposure_s)


def draw_truth(campaign: Campaign, cell: Cell, realisation: int) -> Sky:
    """The sky of one realisation in the band of a cell."""
    response = cell_response(campaign, cell)
    rng = partial(stream, realisation_key(cell.sky_stream_key, realisation))
    return draw_sky(campaign.sky, SkyContext(response.band, response.half_width_arcsec, rng, sky_images(campaign)))


def draw_field(campaign: Campaign, cell: Cell, realisation: int) -> Field:
    """Truth and observation of one realisation of a cell (realisation ≥ 0)."""
    from survey_mc.telescope.expose import expose  # loads the compiler, which a driver does without

    sky = draw_truth(campaign, cell, realisation)
    key = realisation_key(cell.field_key, realisation)
    return expose(sky, cell_response(campaign, cell), partial(stream, key), key)
