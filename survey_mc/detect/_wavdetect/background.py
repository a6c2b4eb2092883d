"""Background of a Mexican-hat transform, and the correlation above it.

Idea     with W = PW + NW (core and ring), D the photons and E the exposure, the rate of the sky is (NW⋆D)/(NW⋆E), and
         C = W⋆D − (W⋆E)·rate has mean 0 on an empty sky, whatever the exposure does. Pixels that stand out are replaced
         by the background and the ring is read again, always from the original photons; then C is compared with its
         threshold for that background. One map for measuring sources is the ratio of the sums over all rings.
Source   Freeman et al. 2002, ApJS 138, 185, Sect. 3; CIAO ahelp wtransform, wrecon.
Limits   small rings hold few photons (25σ² pixels of effective area): the background of the smallest scales is noisy,
         and the wings of sources are in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from survey_mc.detect._shared.convolution import Float32Image, Transform
from survey_mc.detect._wavdetect.thresholds import LOWEST_LOG2, Thresholds
from survey_mc.detect._wavdetect.transform import (
    Bank,
    Coverage,
    RingCoverage,
    ScaleImages,
    coverages,
    pixels_above,
    square_transform,
)
from survey_mc.types import BoolArray

LEAST_BACKGROUND = np.float32(2.0**LOWEST_LOG2)  # counts per pixel; where a ring holds no photon


@dataclass(frozen=True, slots=True)
class Cleansing:
    """How the background is freed of sources.

    false_alarm: tail that marks a pixel as source; max_iter: most rounds; iter_stop: change of the number of marked
    pixels, as a share of all, that ends them.
    """

    false_alarm: float
    max_iter: int
    iter_stop: float


def rate_from_ring(ring_counts: Float32Image, per_ring: Float32Image) -> Float32Image:
    """Counts per pixel of full exposure, never quite 0; the least where the ring sees nothing."""
    rate: Float32Image = ring_counts * per_ring
    np.maximum(rate, LEAST_BACKGROUND, out=rate)
    return rate


def cleansed_ring(
    photons: Float32Image,
    relative: Float32Image,
    correlation: Float32Image,
    ring_counts: Float32Image,
    kernels: Bank,
    i: int,
    coverage: Coverage,
    ring: RingCoverage,
    thresholds: Thresholds,
    cleansing: Cleansing,
) -> Float32Image:
    """−NW⋆D of the photons with source pixels replaced by the background; ring_counts: of the original photons."""
    marked_before = 0
    for _ in range(cleansing.max_iter):
        rate = rate_from_ring(ring_counts, ring.per_exposure)
        images = ScaleImages(kernels.scales[i], correlation, coverage.wavelet, coverage.noise, rate)
        marked = pixels_above(images, thresholds, cleansing.false_alarm)
        if len(marked) == 0:
            break
        cleansed = photons.copy()
        cleansed.ravel()[marked] = rate.ravel()[marked] * relative.ravel()[marked]
        ring_counts = kernels.convolver.apply(kernels.convolver.image(cleansed), kernels.ring(i))
        if abs(len(marked) - marked_before) <= cleansing.iter_stop * photons.size:
            break
        marked_before = len(marked)
    return ring_counts


def scales_over_rings(
    photons: Float32Image,
    relative: Float32Image,
    light: Transform,
    kernels: Bank,
    thresholds: list[Thresholds],
    first_ring: int,
    cleansing: Cleansing,
) -> tuple[list[ScaleImages], Float32Image]:
    """Images of every scale with the background from the rings, and one background map (counts per pixel).

    light: transform of the photons; first_ring: smaller scales borrow the background of this one.
    """
    seen = coverages(relative.tobytes(), relative.shape, kernels.scales, first_ring)
    ring_counts, ring_exposure = np.zeros_like(photons), np.zeros_like(photons)
    rate = np.zeros_like(photons)
    images: list[ScaleImages] = []
    for i in reversed(range(len(kernels.scales))):
        correlation = kernels.convolver.apply(light, kernels.wavelets[i])
        ring = seen[i].ring
        if ring is not None:
            counts = kernels.convolver.apply(light, kernels.ring(i))
            counts = cleansed_ring(
                photons, relative, correlation, counts, kernels, i, seen[i], ring, thresholds[i], cleansing
            )
            rate = rate_from_ring(counts, ring.per_exposure)
            ring_counts += np.where(ring.exposure > 0.0, counts, np.float32(0.0))
            ring_exposure += ring.exposure
        images.append(ScaleImages(kernels.scales[i], correlation, seen[i].wavelet, seen[i].noise, rate))
    overall = photons.sum(dtype=np.float64) / relative.sum(dtype=np.float64)
    mean = np.full(photons.shape, overall, dtype=np.float32)
    np.divide(ring_counts, ring_exposure, out=mean, where=ring_exposure > 0.0)
    return images[::-1], np.maximum(mean, LEAST_BACKGROUND) * relative


def scales_over_known_sky(
    background: Float32Image, analysed: BoolArray, light: Transform, kernels: Bank
) -> list[ScaleImages]:
    """Images of every scale over a known background (counts per pixel)."""
    sky = kernels.convolver.image(background)
    rate = np.ones_like(background)
    images = []
    for i, sigma_pix in enumerate(kernels.scales):
        correlation = kernels.convolver.apply(light, kernels.wavelets[i])
        expected = kernels.convolver.apply(sky, kernels.wavelets[i])
        noise = kernels.convolver.apply(sky, square_transform(kernels.convolver, sigma_pix))
        noise = np.where(analysed, np.maximum(noise, LEAST_BACKGROUND), np.float32(0.0))
        images.append(ScaleImages(sigma_pix, correlation, expected, noise, rate))
    return images
