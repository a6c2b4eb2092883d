"""Whole photons of an image from which out-of-time events were subtracted.

Idea     a CCD that reads out while it exposes smears a fraction f of the photons along its columns. XMM-Newton
         pipelines subtract f × M, M a simulated image of whole events, so a pixel holds N − f·M. As long as f·M < 1
         everywhere, N is the value rounded up, exactly, and the image is a photon image again (with its out-of-time
         events in it).
Source   fractions of EPIC-pn: 6.3 % full frame, 2.3 % extended full frame, 0.16 % large window (XMM-Newton Users'
         Handbook).
Limits   recognised only if every shortfall is a multiple of one f in the range below; anything else that is not whole
         was smoothed, divided or subtracted otherwise, and is refused by the caller.
"""

from __future__ import annotations

import numpy as np

from survey_mc.types import FloatImage

FRACTION_RANGE = (0.001, 0.1)
LEAST_PIXELS = 20  # fewer fractional pixels could be multiples of something by chance
TOLERANCE = 0.02  # of f


def restore_whole_counts(values: FloatImage) -> tuple[FloatImage, float] | None:
    """Whole counts and the fraction f, or None if the image is not of the form N − f·M with f·M < 1.

    values: finite pixels of any shape.
    """
    whole = np.ceil(values - TOLERANCE * FRACTION_RANGE[0])
    shortfall = whole - values
    fractional = shortfall[shortfall > 0.5 * FRACTION_RANGE[0]]
    if fractional.size < LEAST_PIXELS or whole.min() < 0.0:
        return None
    fraction = float(fractional.min())
    if not FRACTION_RANGE[0] <= fraction <= FRACTION_RANGE[1]:
        return None
    # The smallest shortfall is one event; rounding of single-precision files is averaged out over all of them.
    events = np.rint(fractional / fraction)
    fraction = float(np.sum(fractional * events) / np.sum(events * events))
    if np.abs(fractional - fraction * np.rint(fractional / fraction)).max() > TOLERANCE * fraction:
        return None
    return whole, fraction
