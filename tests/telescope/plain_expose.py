"""Skies to expose, and the same drawing written plainly in numpy: the oracle of the compiled loops.

Nothing is shared with the product but the numbers of the response: uniform background photons thinned one by one,
King radii by the inverse of the encircled energy, no ordering.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import pandas as pd

from survey_mc.array_frame import ArrayFrame
from survey_mc.rng import stream
from survey_mc.telescope import InstrumentSettings
from survey_mc.telescope.expose import expose
from survey_mc.telescope.response import Response, build_response
from survey_mc.types import Field, Sky

BARE = InstrumentSettings(psf=False, vignetting=False, background=False, field_of_view=False)
NO_SKY = Sky(ArrayFrame.of_frame(pd.DataFrame({
    "kind": pd.Series(["point"]).iloc[:0],
    "x_arcsec": np.empty(0), "y_arcsec": np.empty(0), "flux_cgs": np.empty(0), "rate_cps": np.empty(0),
    "core_radius_arcsec": np.empty(0), "beta": np.empty(0), "redshift": np.empty(0),
    "group_id": np.empty(0, np.int32), "group_sep_arcsec": np.empty(0),
})))  # fmt: skip


def sky_of(*sources: tuple[float, float, float], core_radius_arcsec: float = np.nan, beta: float = np.nan) -> Sky:
    """Sources given as (x_arcsec, y_arcsec, rate_cps), all points or all with the same β-model."""
    x_arcsec, y_arcsec, rate_cps = np.array(sources, dtype=float).T
    n = len(sources)
    return Sky(ArrayFrame.of_frame(pd.DataFrame({
        "kind": ["point" if np.isnan(core_radius_arcsec) else "extended"] * n,
        "x_arcsec": x_arcsec, "y_arcsec": y_arcsec, "flux_cgs": rate_cps * 6.70e-13, "rate_cps": rate_cps,
        "core_radius_arcsec": core_radius_arcsec, "beta": beta, "redshift": np.nan,
        "group_id": np.full(n, -1, np.int32), "group_sep_arcsec": np.nan,
    })))  # fmt: skip


def field_of(sky: Sky, settings: InstrumentSettings, exposure_s: float, key: str = "field") -> Field:
    """The field the product draws in the soft band."""
    return expose(sky, build_response(settings, "soft", exposure_s), partial(stream, key), key)


def plain_photons(sky: Sky, response: Response, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) photon positions in pixels and their origins, in no order."""
    ny, nx = response.grid.shape
    n_background = rng.poisson(response.background_expected.max() * ny * nx)
    xy_pix = rng.uniform(-0.5, [nx - 0.5, ny - 0.5], (n_background, 2))
    expected = response.background_expected[tuple(np.rint(xy_pix.T[::-1]).astype(int))]
    photons = [xy_pix[rng.random(n_background) * response.background_expected.max() < expected]]
    origins = [np.full(len(photons[0]), -1)]
    for number, source in sky.sources.iterrows():
        n = rng.poisson(source["rate_cps"] * response.exposure_s)
        xy_arcsec = np.tile([source["x_arcsec"], source["y_arcsec"]], (n, 1)).astype(float)
        if source["kind"] == "extended":
            power = 1.0 / (3.0 * source["beta"] - 1.5)
            xy_arcsec += ring(rng, source["core_radius_arcsec"] * np.sqrt(rng.random(n) ** -power - 1.0))
        xy_arcsec = xy_arcsec[rng.random(n) < response_at(response, np.hypot(*xy_arcsec.T) / 60.0)]
        if response.psf is not None:
            power = 1.0 / (response.psf.slope - 1.0)
            radius = response.psf.core_radius_arcsec * np.sqrt(rng.random(len(xy_arcsec)) ** -power - 1.0)
            xy_arcsec = xy_arcsec + ring(rng, radius)
        xy_pix = xy_arcsec / response.grid.scale_arcsec + np.array(response.grid.axis_pix)
        column, row = np.floor(np.clip(xy_pix.T, -1e6, 1e6) + 0.5).astype(int)
        on_image = (column >= 0) & (column < nx) & (row >= 0) & (row < ny)
        on_image[on_image] = response.in_view[row[on_image], column[on_image]]
        photons.append(xy_pix[on_image])
        origins.append(np.full(int(on_image.sum()), number))
    return np.concatenate(photons), np.concatenate(origins)


def ring(rng: np.random.Generator, radius: np.ndarray) -> np.ndarray:
    angle = rng.uniform(0.0, 2.0 * np.pi, len(radius))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def response_at(response: Response, offaxis_arcmin: np.ndarray) -> np.ndarray:
    """Vignetting at angles, 0 outside the field of view."""
    x = np.minimum(offaxis_arcmin, 15.0) / 10.0
    quartic = 1.0 + sum(c * x ** (k + 1) for k, c in enumerate(response.vignetting))
    return np.where(offaxis_arcmin <= response.field_of_view_arcmin, quartic, 0.0)
