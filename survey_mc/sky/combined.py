"""Several skies on top of each other.

Idea     the parts are drawn each by its own recipe, their sources in the order of the parts. The first part of a kind
         has the same random streams as that kind alone, so that adding clusters to a random field leaves its points
         where they were (paper Sect. 7); a second part of a kind gets streams of its own.
Limits   a part cannot be combined again.
"""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Literal

from pydantic import Field

from survey_mc.array_frame import ArrayFrame
from survey_mc.sky import clusters, empty, flux_grid, image, lognlogs, pair_rows
from survey_mc.sky.kind import SkyContext, SkyKind, SkyParams
from survey_mc.types import Sky, SkyImage

SIMPLE_KINDS = (lognlogs.KIND, pair_rows.KIND, flux_grid.KIND, clusters.KIND, image.KIND, empty.KIND)
_KIND_BY_NAME = {kind.name: kind for kind in SIMPLE_KINDS}

SimpleSkyParams = Annotated[
    lognlogs.LogNLogSParams
    | pair_rows.PairRowsParams
    | flux_grid.FluxGridParams
    | clusters.ClustersParams
    | image.ImageParams
    | empty.EmptyParams,
    Field(discriminator="kind"),
]


class CombinedParams(SkyParams):
    """Several skies on top of each other."""

    kind: Literal["combined"] = "combined"
    parts: tuple[SimpleSkyParams, ...] = Field(min_length=1, max_length=20, description="the skies, each with its kind")


def draw(params: CombinedParams, context: SkyContext) -> Sky:
    """The sources of all parts, in the order of the parts."""
    seen: Counter[str] = Counter()
    skies: list[Sky] = []
    for part in params.parts:
        repeated = seen[part.kind]
        seen[part.kind] += 1
        own = context.with_streams_of(f"{part.kind}{repeated + 1}") if repeated else context
        skies.append(_KIND_BY_NAME[part.kind].draw(part, own))
    images: tuple[SkyImage, ...] = tuple(picture for sky in skies for picture in sky.images)
    return Sky(ArrayFrame.together([sky.source_rows for sky in skies]), images)


KIND = SkyKind(
    name="combined",
    about="several skies on top of each other",
    params=CombinedParams,
    draw=draw,
    tiny=CombinedParams(parts=(lognlogs.KIND.tiny, clusters.KIND.tiny)),  # type: ignore[arg-type]
)
