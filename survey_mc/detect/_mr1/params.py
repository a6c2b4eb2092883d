"""Parameters of the MR/1 filter and the images they fit.

Idea     every option of the filter is named; kept apart from the filter, so that reading a campaign compiles nothing.
Source   paper Sect. 3.4 for the values; options of mr_filter and mr_pfilter of the MR/1 package.
"""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from survey_mc.detect.detector import DetectorParams

PROJECTION = (1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0)  # cubic B-spline at the integers
PROJECTION_SIGMA_PIX = math.sqrt(2.0 / 6.0)

BorderName = Literal["mirror", "nearest"]


class Mr1Params(DetectorParams):
    """Parameters of the multiresolution filter."""

    n_scales: int = Field(
        6, ge=2, le=12, description="number of scales, the last smooth plane included: n − 1 wavelet planes (MR/1: -n)"
    )
    significance: float = Field(
        1e-4, ge=1e-9, le=0.1, description="false-alarm probability of a coefficient, in each tail (MR/1: -E)"
    )
    iterations: int = Field(25, ge=1, le=1000, description="largest number of iterations of the restoration (MR/1: -i)")
    tolerance: float = Field(
        1e-5, ge=0.0, description="stop when Σ residual² per pixel changes by less than this (counts²; MR/1: -C)"
    )
    first_scale: int = Field(2, ge=1, le=12, description="finest wavelet plane that is used, from 1 (MR/1: -F)")
    positive_only: bool = Field(True, description="only positive coefficients may be significant (MR/1: -p)")
    kill_isolated: bool = Field(
        True, description="drop support pixels alone in their plane with nothing one plane up (MR/1: -k)"
    )
    suppress_last_scale: bool = Field(False, description="leave the smooth plane out of the restored image (MR/1: -K)")
    min_events: int = Field(
        4, ge=1, le=1000, description="photons in the box below which no coefficient is significant (MR/1: -e)"
    )
    grow_support: bool = Field(
        False, description="residual coefficients that become significant join the support (MR/1: Sup_Set)"
    )
    positive_image: bool = Field(True, description="the restored image is kept ≥ 0 in every iteration")
    reconstruction: Literal["adjoint", "sum"] = Field(
        "adjoint", description="adjoint scheme, which keeps extended sources whole, or the plain sum of the planes"
    )
    border: BorderName = Field("mirror", description="continuation of the image beyond its border")


def largest_n_scales(shape: tuple[int, int]) -> int:
    """Most scales an image can take: the largest photon box, half-size 2^n_scales, must fit by one reflection."""
    return max(0, (min(shape) - 1).bit_length() - 1)


def check_scales(params: Mr1Params, shape: tuple[int, int]) -> None:
    """Raise ValueError when the scales do not fit the image or leave no wavelet plane."""
    largest = largest_n_scales(shape)
    if not 2 <= params.n_scales <= largest:
        allowed = f"2..{largest}" if largest >= 2 else "nothing (the image is too small for this filter)"
        raise ValueError(f"n_scales must be {allowed} for a {min(shape)}-pixel image (got {params.n_scales})")
    if params.first_scale > params.n_scales - 1:
        allowed = f"1..{params.n_scales - 1} for n_scales = {params.n_scales}"
        raise ValueError(f"first_scale must be {allowed} (got {params.first_scale})")
