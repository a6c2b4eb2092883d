"""Contexts to draw skies in."""

from __future__ import annotations

from functools import partial

import numpy as np

from survey_mc.rng import stream
from survey_mc.sky import SkyContext
from survey_mc.types import Band, SkyImage

SOFT = Band("soft", 0.5, 2.0, 6.70e-13)
HARD = Band("hard", 2.0, 10.0, 3.66e-12)
HALF_WIDTH_ARCSEC = 1024.0


def context(key: str = "sky", band: Band = SOFT) -> SkyContext:
    """A 512 × 512 field of 4″ pixels, with one small image."""
    images = {"tiny.fits": SkyImage(np.full((8, 8), 1e-4), 4.0)}
    return SkyContext(band, HALF_WIDTH_ARCSEC, partial(stream, key), images)
