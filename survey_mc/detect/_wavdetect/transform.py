"""Mexican-hat transform of a photon image over a list of scales, and its significant maxima.

Idea     with W = PW + NW (core and ring), D the photons and E the exposure, C = W⋆D minus its expectation on an empty
         sky is searched for maxima above a threshold that follows the background.
         Unobserved pixels and what lies beyond the image are one thing: E = 0.
Source   Freeman et al. 2002, ApJS 138, 185, Sect. 3. Differs: where a part of the kernel sees less exposure, the
         threshold is that of the flat field with the same variance of C, so edges and gaps need no special case. (On
         half a kernel C has the distribution it has on the whole kernel over half the background.)
Limits   a ring that sees less than a twentieth of what it should leaves its pixel out at that scale.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from survey_mc.caches import bounded_cache
from survey_mc.detect._shared.convolution import Convolver, Float32Image, KernelTransform, Transform
from survey_mc.detect._shared.mexican_hat import half_size_pix, mexican_hat, negative_part
from survey_mc.detect._wavdetect.thresholds import Thresholds
from survey_mc.types import BoolArray, FloatArray

Scales = tuple[float, ...]
Pixels = NDArray[np.int64]  # flat indices

LEAST_RING_SHARE = 0.05
CACHED_EXPOSURES = 1  # 16 images of a 512² field each


@dataclass(frozen=True, slots=True)
class Bank:
    """Transforms of the wavelets for one image shape."""

    convolver: Convolver
    scales: Scales
    wavelets: tuple[KernelTransform, ...]

    def ring(self, i: int) -> KernelTransform:
        """Transform of the ring of a scale (−NW ≥ 0)."""
        return ring_transform(self.convolver, self.scales[i])


@dataclass(frozen=True, slots=True)
class RingCoverage:
    """What a ring sees of the exposure E (1 at its maximum): −NW⋆E, 0 where it sees too little, and 1 over it or 0."""

    exposure: Float32Image
    per_exposure: Float32Image


@dataclass(frozen=True, slots=True)
class Coverage:
    """What one scale sees of the exposure E (1 at its maximum).

    wavelet: W⋆E; noise: variance of C per unit rate over ΣW², 0 where the scale is not analysed; ring: None where the
    background is that of a larger scale.
    """

    wavelet: Float32Image
    noise: Float32Image
    ring: RingCoverage | None


@dataclass(frozen=True, slots=True)
class ScaleImages:
    """One scale over one sky, float32 (ny, nx): C = correlation − exposure · rate has mean 0 on empty sky.

    noise · rate: the flat background (counts per pixel) over which C is as noisy; noise is 0 where not analysed.
    """

    sigma_pix: float
    correlation: Float32Image
    exposure: Float32Image
    noise: Float32Image
    rate: Float32Image


@bounded_cache(2)
def bank(shape: tuple[int, int], scales: Scales) -> Bank:
    """Transforms of all the kernels."""
    convolver = Convolver(shape, half_size_pix(scales[-1]))
    return Bank(convolver, scales, tuple(convolver.kernel(mexican_hat(sigma)) for sigma in scales))


@bounded_cache(16)
def ring_transform(convolver: Convolver, sigma_pix: float) -> KernelTransform:
    """Transform of the ring −NW."""
    return convolver.kernel(-negative_part(mexican_hat(sigma_pix)))


def square_transform(convolver: Convolver, sigma_pix: float) -> KernelTransform:
    """Transform of W²/ΣW²."""
    squares = np.square(mexican_hat(sigma_pix))
    return convolver.kernel(squares / squares.sum())


@bounded_cache(CACHED_EXPOSURES)
def coverages(exposure: bytes, shape: tuple[int, int], scales: Scales, first_ring: int) -> tuple[Coverage, ...]:
    """Coverage of every scale; fields of one campaign share their exposure, hence the cache.

    exposure: bytes of the float32 image; scales before `first_ring` borrow the background of that scale's ring.
    """
    kernels = bank(shape, scales)
    relative = np.frombuffer(exposure, dtype=np.float32).reshape(shape)
    transform = kernels.convolver.image(relative)
    return tuple(scale_coverage(kernels, i, relative, transform, i >= first_ring) for i in range(len(scales)))


def scale_coverage(kernels: Bank, i: int, relative: Float32Image, exposure: Transform, own_ring: bool) -> Coverage:
    """Coverage of one scale; own_ring: its background is read from its own ring, whose noise then counts."""
    apply = kernels.convolver.apply
    hat = mexican_hat(kernels.scales[i])
    wavelet = apply(exposure, kernels.wavelets[i])
    noise = apply(exposure, square_transform(kernels.convolver, kernels.scales[i]))
    ring = None
    if own_ring:
        full_ring = -float(negative_part(hat).sum())
        light = apply(exposure, kernels.ring(i))
        seen = (relative > 0.0) & (light >= LEAST_RING_SHARE * full_ring * relative)
        light = np.where(seen, light, np.float32(0.0))
        ring = RingCoverage(light, np.divide(1.0, light, out=np.zeros_like(light), where=seen))
        # C − (W⋆E)·rate weighs a ring pixel by NW · (PW⋆E)/(−NW⋆E) instead of NW.
        ring_squares = kernels.convolver.kernel(np.square(negative_part(hat)) / np.square(hat).sum())
        weight = (wavelet + light) * ring.per_exposure
        noise += (np.square(weight) - np.float32(1.0)) * apply(exposure, ring_squares)
        noise[~seen] = 0.0
    noise[relative <= 0.0] = 0.0
    return Coverage(wavelet, np.maximum(noise, np.float32(0.0)), ring)


def pixels_above(images: ScaleImages, thresholds: Thresholds, false_alarm: float) -> Pixels:
    """Flat indices of the analysed pixels with C > C_t."""
    pixels, excess, background = likely_pixels(images, thresholds, false_alarm)
    return pixels[excess > thresholds.at(background, false_alarm)]


def significant_maxima(
    images: ScaleImages, thresholds: Thresholds, false_alarm: float, observed: BoolArray
) -> tuple[Pixels, FloatArray]:
    """Flat indices of the pixels with C > C_t that are above all observed neighbours, and C/C_t there."""
    from survey_mc.detect._wavdetect.kernels import are_maxima

    pixels, excess, background = likely_pixels(images, thresholds, false_alarm)
    highest = are_maxima(images.correlation, images.exposure, images.rate, observed, pixels)
    ratio = excess[highest] / thresholds.at(background[highest], false_alarm)
    return pixels[highest][ratio > 1.0], ratio[ratio > 1.0]


def likely_pixels(
    images: ScaleImages, thresholds: Thresholds, false_alarm: float
) -> tuple[Pixels, FloatArray, FloatArray]:
    """Flat indices, C and equivalent background of all pixels that can be above the threshold."""
    from survey_mc.detect._wavdetect import kernels

    sure = thresholds.certainly_above(false_alarm)
    pixels, excess, background = kernels.likely_pixels(
        images.correlation, images.exposure, images.noise, images.rate, sure**2, thresholds.least
    )
    return np.asarray(pixels), np.asarray(excess), np.asarray(background)
