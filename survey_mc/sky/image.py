"""A sky given as an image, for instance from a numerical simulation.

Idea     the file is opened elsewhere; here its pixels become on-axis count rates. The telescope turns each pixel into
         photons, uniform inside it.
Source   paper Sect. 2 (the response applied directly over images).
Limits   square pixels, north as the detector's y, centred on the optical axis; no sources are known in it, so that the
         photons of the image are one row of the truth, of kind "image".
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from survey_mc.errors import BadInput
from survey_mc.sky.kind import SkyContext, SkyKind, SkyParams, source_rows
from survey_mc.types import Sky, SkyImage


class ImageParams(SkyParams):
    """A sky image of the user."""

    kind: Literal["image"] = "image"
    path: str = Field(min_length=1, description="FITS image, relative to the campaign file")
    quantity: Literal["rate", "flux"] = Field(
        "rate", description="what a pixel holds: rate (ct/s on axis) or flux (erg/cm²/s), per pixel"
    )
    scale_arcsec: float = Field(gt=0.0, le=600.0, description="side of its pixels, arcsec")
    factor: float = Field(1.0, gt=0.0, description="the pixels are multiplied by this number")


def draw(params: ImageParams, context: SkyContext) -> Sky:
    """A sky without sources and with one image. Raises BadInput for a missing image or negative pixels."""
    where = f"sky.path {params.path!r}"
    if params.path not in context.images:
        raise BadInput(where, f"the image was not opened; opened: {', '.join(sorted(context.images)) or 'none'}")
    pixels = np.asarray(context.images[params.path].rate_cps, dtype=np.float64) * params.factor
    if pixels.ndim != 2 or pixels.size == 0:
        raise BadInput(where, f"must be an image of two dimensions (got shape {pixels.shape})")
    if not (np.isfinite(pixels).all() and pixels.min() >= 0.0):
        raise BadInput(where, "every pixel must be a finite number, 0 or larger")
    rate_cps = context.rate_cps(pixels) if params.quantity == "flux" else pixels
    rate_cps.setflags(write=False)
    nothing = np.empty(0)
    sources = source_rows("point", nothing, nothing, nothing, nothing)
    return Sky(sources, (SkyImage(rate_cps, params.scale_arcsec),))


KIND = SkyKind(
    name="image",
    about="a sky given as a FITS image of count rate or flux",
    params=ImageParams,
    draw=draw,
    tiny=ImageParams(path="tiny.fits", scale_arcsec=4.0),
)
