"""What of an observation can be used: observed pixels, and the background map a campaign grants."""

from __future__ import annotations

import numpy as np

from survey_mc.types import BoolArray, FloatImage, Observation

LEAST_EXPOSURE_S = 1e-100  # below it rates and their ratios leave the range of numbers


def observed_pixels(observation: Observation) -> BoolArray:
    """True where the exposure is positive. Raises ValueError for an exposure or counts that cannot be used."""
    exposure, counts = observation.exposure_s, observation.counts
    if exposure.shape != counts.shape:
        raise ValueError(f"exposure_s must have the shape of counts, {counts.shape} (got {exposure.shape})")
    if not np.all(np.isfinite(exposure)) or exposure.min() < 0.0:
        raise ValueError("exposure_s must be finite and ≥ 0, 0 where not observed (got NaN, infinite or < 0)")
    observed = np.asarray(exposure > 0.0)
    if exposure.min(initial=np.inf, where=observed) < LEAST_EXPOSURE_S:
        raise ValueError(f"exposure_s must be 0 or at least {LEAST_EXPOSURE_S:g} s (got {exposure[observed].min():g})")
    if counts.min() < 0:
        raise ValueError(f"counts must be ≥ 0 (got {counts.min()})")
    return observed


def granted_background(observation: Observation) -> FloatImage:
    """The background map (counts per pixel) the campaign grants; ValueError if it grants none."""
    if observation.background is None:
        raise ValueError('background = "granted" needs an observation with a background map (got none)')
    return observation.background
