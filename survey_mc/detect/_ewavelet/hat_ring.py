"""Mexican-hat and background-ring convolutions of an image at several scales.

Idea     the background of scale σ is the image convolved with the ring r² exp(−r²/2σ_b²), σ_b = 2σ, over the same of
         the exposure, so that neither border, mask nor vignetting pulls it down. What the hat makes of the exposure's
         own structure, times that rate, is no source and is subtracted: C′ = W⋆D − (W⋆E)·rate.
Source   ring and its width: ewavelet of the XMM-Newton SAS (Damiani et al. 1997); correction for the exposure: Freeman
         et al. 2002, ApJS 138, 185.
Limits   relative exposure, 0 … 1. The ring is cut at 4σ_b. Filters and exposure responses of the last image shapes and
         exposure maps are kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from survey_mc.caches import bounded_cache
from survey_mc.detect._shared.convolution import Convolver, Float32Image, KernelTransform
from survey_mc.detect._shared.mexican_hat import half_size_pix, mexican_hat
from survey_mc.types import FloatImage

RING_PER_SCALE = 2.0  # σ_b / σ
RING_REACH_SIGMA = 4.0  # 0.3 % of the ring lies beyond
LEAST_COVERAGE = 0.05  # exposed share of the ring below which it measures nothing
LEAST_RATE = 1e-6  # counts per pixel; keeps an empty image finite


@dataclass(frozen=True, slots=True, eq=False)
class HatRing:
    """Transforms of the hats and rings of all scales for images of one shape; equal only to itself."""

    convolver: Convolver
    hats: tuple[KernelTransform, ...]
    rings: tuple[KernelTransform, ...]


@dataclass(frozen=True, slots=True)
class ExposureResponse:
    """Hat and ring convolutions of the relative exposure, one image a scale."""

    hats: tuple[Float32Image, ...]
    rings: tuple[Float32Image, ...]


def ring_half_pix(sigma_pix: float) -> int:
    """Half-size of the ring's stamp."""
    return math.ceil(RING_REACH_SIGMA * RING_PER_SCALE * sigma_pix)


def ring(sigma_pix: float) -> FloatImage:
    """(2h + 1)² background ring of scale σ, Σ = 1."""
    half = ring_half_pix(sigma_pix)
    offset = np.arange(-half, half + 1) / (RING_PER_SCALE * sigma_pix)
    r2 = np.square(offset)[:, None] + np.square(offset)
    values = np.where(r2 <= RING_REACH_SIGMA**2, r2 * np.exp(-0.5 * r2), 0.0)
    return np.asarray(values / values.sum())


@bounded_cache(2)
def hat_ring(shape: tuple[int, int], scales_pix: tuple[float, ...], ring_scales_pix: tuple[float, ...]) -> HatRing:
    """Filters of all scales; the ring of a scale may be that of a larger one."""
    reach = max(half_size_pix(max(scales_pix)), ring_half_pix(max(ring_scales_pix)))
    convolver = Convolver(shape, reach)
    transforms = {sigma: convolver.kernel(ring(sigma)) for sigma in sorted(set(ring_scales_pix))}
    hats = tuple(convolver.kernel(mexican_hat(sigma)) for sigma in scales_pix)
    return HatRing(convolver, hats, tuple(transforms[sigma] for sigma in ring_scales_pix))


@bounded_cache(1)
def _exposure_response(exposure: bytes, filters: HatRing) -> ExposureResponse:
    shape = filters.convolver.shape
    transform = filters.convolver.image(np.frombuffer(exposure, dtype=np.float32).reshape(shape))
    hats = tuple(filters.convolver.apply(transform, hat) for hat in filters.hats)
    return ExposureResponse(hats, tuple(filters.convolver.apply(transform, one) for one in filters.rings))


def exposure_response(exposure: Float32Image, filters: HatRing) -> ExposureResponse:
    """Responses to the relative exposure; most fields of a campaign share one exposure map, so the last are kept."""
    return _exposure_response(exposure.tobytes(), filters)


def mean_rate(image: Float32Image, exposure: Float32Image) -> float:
    """Counts per fully exposed pixel of the whole image."""
    return max(float(image.sum(dtype=np.float64) / exposure.sum(dtype=np.float64)), LEAST_RATE)
