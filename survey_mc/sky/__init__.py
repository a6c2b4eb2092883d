"""What is up there: populations of true sources, each a recipe with its parameters."""

from typing import Annotated

from pydantic import Field

from survey_mc.registry import Registry
from survey_mc.sky import combined
from survey_mc.sky.clusters import ClustersParams
from survey_mc.sky.combined import CombinedParams
from survey_mc.sky.empty import EmptyParams
from survey_mc.sky.flux_grid import FluxGridParams
from survey_mc.sky.image import ImageParams
from survey_mc.sky.kind import SkyContext, SkyKind, SkyParams
from survey_mc.sky.lognlogs import LogNLogSParams
from survey_mc.sky.pair_rows import PairRowsParams
from survey_mc.sky.relations import RELATIONS
from survey_mc.types import Sky

SKIES: Registry[SkyKind] = Registry("sky", [*combined.SIMPLE_KINDS, combined.KIND])

AnySkyParams = Annotated[
    LogNLogSParams | PairRowsParams | FluxGridParams | ClustersParams | ImageParams | EmptyParams | CombinedParams,
    Field(discriminator="kind"),
]


def draw_sky(params: SkyParams, context: SkyContext) -> Sky:
    """The true sources of one realisation, by the kind the parameters name."""
    return SKIES[params.kind].draw(params, context)


__all__ = ["RELATIONS", "SKIES", "AnySkyParams", "SkyContext", "SkyKind", "SkyParams", "draw_sky"]
