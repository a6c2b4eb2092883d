"""An image with out-of-time events subtracted is a photon image again; nothing else that is not whole is."""

from __future__ import annotations

import numpy as np
import pytest

from survey_mc.fits.out_of_time import restore_whole_counts
from survey_mc.rng import stream


def subtracted(fraction: float, dtype: str = "f8") -> tuple[np.ndarray, np.ndarray]:
    rng = stream("out of time", "test")
    photons, events = rng.poisson(0.3, (64, 64)), rng.poisson(0.2, (64, 64))
    return photons, (photons - fraction * events).astype(dtype).astype(np.float64)


@pytest.mark.parametrize("fraction", [0.063, 0.023, 0.0016])
@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_photons_are_restored_exactly(fraction: float, dtype: str) -> None:
    photons, values = subtracted(fraction, dtype)

    found = restore_whole_counts(values)

    assert found is not None
    np.testing.assert_array_equal(found[0], photons)
    assert found[1] == pytest.approx(fraction, rel=1e-4)


def test_other_fractions_are_not_taken_for_out_of_time_events() -> None:
    photons, values = subtracted(0.063)
    rng = stream("out of time", "noise")

    assert restore_whole_counts(photons.astype(float)) is None
    assert restore_whole_counts(photons - 0.5 * (photons > 0)) is None
    assert restore_whole_counts(photons - rng.uniform(0.0, 0.3, photons.shape)) is None
    assert restore_whole_counts(photons / 1.7) is None
    assert restore_whole_counts(values - 1.0) is None
