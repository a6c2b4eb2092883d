"""The place of a background photon along the accumulated expectation, against a plain search."""

import numpy as np
import pytest

from survey_mc.telescope import _order


@pytest.mark.parametrize("share_of_zero", [0.0, 0.5, 0.95])
@pytest.mark.parametrize("n_pix", [1, 7, 9, 400])
def test_every_level_falls_into_the_pixel_whose_edges_hold_it(share_of_zero, n_pix):
    rng = np.random.default_rng(n_pix)
    means = np.where(rng.random(n_pix) < share_of_zero, 0.0, rng.exponential(1.0, n_pix))
    means[rng.integers(n_pix)] = 1.0
    edges = np.concatenate(([0.0], np.cumsum(means)))
    levels = np.sort(np.concatenate((rng.uniform(0.0, edges[-1], 300), edges[:-1][edges[:-1] < edges[-1]])))
    edges.setflags(write=False)
    pixel, found = 0, []
    for level in levels:
        pixel = _order._pixel_of_level(edges, pixel, level)
        found.append(pixel)
    assert np.array_equal(found, np.searchsorted(edges[1:], levels, side="right"))
