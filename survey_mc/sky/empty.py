"""No sources: a field of background alone, for false detections."""

from __future__ import annotations

from typing import Literal

import numpy as np

from survey_mc.sky.kind import SkyContext, SkyKind, SkyParams, source_rows
from survey_mc.types import Sky


class EmptyParams(SkyParams):
    """No sources."""

    kind: Literal["empty"] = "empty"


def draw(params: EmptyParams, context: SkyContext) -> Sky:
    """A sky with zero sources."""
    nothing = np.empty(0)
    return Sky(source_rows("point", nothing, nothing, nothing, nothing))


KIND = SkyKind(
    name="empty",
    about="no sources: background alone",
    params=EmptyParams,
    draw=draw,
    tiny=EmptyParams(),
)
