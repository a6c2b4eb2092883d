"""Exposing a sky: photons one by one, each with its origin.

Idea     background, sources and sky images are independent Poisson processes, each with its own random stream, so that
         one more source leaves every background photon where it was. A photon of a source is lost by vignetting
         according to its sky direction, scattered by the PSF, and dropped outside the image and the field of view.
Source   paper Sect. 2.
Limits   no pile-up, chips or time. Photons from sky directions outside the field of view (stray light) are not made.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from survey_mc.array_frame import ArrayFrame, Texts
from survey_mc.telescope import _draw, _order
from survey_mc.telescope.beta_model import profile_directions
from survey_mc.telescope.response import Response
from survey_mc.telescope.vignetting import VALID_ARCMIN
from survey_mc.types import SKY_COLUMNS, Field, FloatArray, IntArray, Observation, Sky, SkyImage
from survey_mc.units import ARCSEC_PER_ARCMIN, flux_from_rate

Streams = Callable[[str], np.random.Generator]

_COPIED = tuple(name for name in SKY_COLUMNS if name not in ("kind", "x_arcsec", "y_arcsec"))


def expose(sky: Sky, response: Response, rng: Streams, key: str) -> Field:
    """Draw one field.

    rng(name): random stream of this field; used are "background", "photons" and "sky_image". key: content key of the
    field. The truth has one row for each source, then one (kind "image") for each sky image.
    """
    sources = _sources(sky.source_rows, response)
    n_sources = len(sources.table)
    photon_rng = rng("photons")
    n_photons = photon_rng.poisson(sources.photons_expected())
    x_arcsec, y_arcsec, number = _draw.source_directions(photon_rng, sources.table, n_photons, *_losses(response))
    parts = [_scattered(photon_rng, x_arcsec, y_arcsec, number, response)]
    if sky.images:
        image_rng = rng("sky_image")
        parts += [_image_photons(image_rng, image, response, n_sources + i) for i, image in enumerate(sky.images)]
    photons = np.concatenate(parts) if len(parts) > 1 else parts[0]
    counts, positions, origin, row_start = _order.merged(
        response.background_expected,
        response.background_edges,
        *_arrivals(rng("background"), float(response.background_edges[-1])),
        _order.sorted_by_row(photons, *response.grid.shape),
    )
    for values in (origin, row_start):
        values.setflags(write=False)
    n_rows = n_sources + len(sky.images)
    drawn = np.bincount(photons[:, 2].astype(np.int32), minlength=n_rows).astype(np.int32)
    return Field(
        key=key,
        truth_rows=_truth(sky, response, sources, drawn),
        origin=origin,
        row_start=row_start,
        background_expected=response.background_expected,
        observation=Observation(
            counts=counts,
            photons_pix=positions,
            exposure_s=response.exposure_map_s,
            background=response.background_expected if response.grants_background else None,
            psf=response.believed_psf,
            grid=response.grid,
            band=response.band,
        ),
    )


def _arrivals(rng: np.random.Generator, total: float) -> tuple[FloatArray, FloatArray]:
    """Arrival levels of a Poisson process up to `total`, each with a uniform number.

    Room is made for 8 standard deviations more than expected.
    """
    levels: FloatArray
    heights: FloatArray
    levels, heights = _draw.arrivals(rng, total, int(total + 8.0 * np.sqrt(total)) + 64)
    return levels, heights


def _losses(response: Response) -> tuple[FloatArray, float, float]:
    """What decides which sky directions are observed: vignetting, where it is known to, radius of the field of view."""
    return np.array(response.vignetting), VALID_ARCMIN, response.field_of_view_arcmin


def _scattered(
    rng: np.random.Generator, x_arcsec: FloatArray, y_arcsec: FloatArray, number: IntArray, response: Response
) -> FloatArray:
    """Photons (n, 3) x, y, origin on the detector, of these sky directions: PSF and edges."""
    psf, grid = response.psf, response.grid
    if psf is None:
        offsets = (np.zeros(x_arcsec.size), np.zeros(x_arcsec.size))
    else:
        offsets = _draw.king_offsets(rng, x_arcsec.size, psf.core_radius_arcsec, 1.0 / (psf.slope - 1.0))
    photons: FloatArray = _draw.on_detector(
        x_arcsec, y_arcsec, number, *offsets, grid.scale_arcsec, *grid.axis_pix, response.in_view
    )
    return photons


@dataclass(frozen=True, slots=True)
class _Sources:
    """What the drawing of n sources needs.

    table: (n, 5) x, y, on-axis counts, core radius (0 for a point) and 1/(3β − 1.5). offaxis_arcmin, seen_share: (n,)
    off-axis angle, and the chance that a photon from there is observed.
    """

    table: FloatArray
    offaxis_arcmin: FloatArray
    seen_share: FloatArray

    def photons_expected(self) -> FloatArray:
        """(n,) mean number of photons to draw: thinned for a point, whose photons share one chance; else on axis.

        Sources beyond the edge of the image count: the wings of their PSF reach into it.
        """
        return self.table[:, 2] * np.where(self.table[:, 3] > 0.0, 1.0, self.seen_share)


def _sources(rows: ArrayFrame, response: Response) -> _Sources:
    table = np.zeros((len(rows), 5))
    table[:, 0] = rows["x_arcsec"]
    table[:, 1] = rows["y_arcsec"]
    table[:, 2] = rows["rate_cps"] * response.exposure_s
    extended = np.flatnonzero(rows["core_radius_arcsec"] > 0.0)
    table[extended, 3] = rows["core_radius_arcsec"][extended]
    table[extended, 4] = 1.0 / (3.0 * rows["beta"][extended] - 1.5)
    offaxis_arcmin = np.hypot(table[:, 0], table[:, 1]) / ARCSEC_PER_ARCMIN
    return _Sources(table, offaxis_arcmin, response.seen_share(offaxis_arcmin))


def _image_photons(rng: np.random.Generator, image: SkyImage, response: Response, number: int) -> FloatArray:
    """Photons (n, 3) x, y, origin on the detector, of a sky image."""
    ny, nx = image.rate_cps.shape
    expected = np.ascontiguousarray(image.rate_cps, dtype=np.float64) * response.exposure_s
    x_sky, y_sky = _draw.place_in_pixels(expected, *_arrivals(rng, float(expected.sum())))
    x_arcsec = (x_sky - (nx - 1) / 2.0) * image.scale_arcsec
    y_arcsec = (y_sky - (ny - 1) / 2.0) * image.scale_arcsec
    kept = _draw.thinned(rng, x_arcsec, y_arcsec, *_losses(response))
    numbers = np.full(int(kept.sum()), number, dtype=np.int32)
    return _scattered(rng, x_arcsec[kept], y_arcsec[kept], numbers, response)


def _truth(sky: Sky, response: Response, sources: _Sources, drawn: IntArray) -> ArrayFrame:
    """The columns of `columns.TRUTH` without `realisation`."""
    rows, grid, n = sky.source_rows, response.grid, len(sources.table)
    counts_onaxis = sources.table[:, 2].copy()
    columns: dict[str, NDArray[Any] | Texts] = {
        "source_id": np.arange(n, dtype=np.int32),
        "kind": rows.texts("kind"),
        "x_arcsec": rows["x_arcsec"],
        "y_arcsec": rows["y_arcsec"],
        "x_pix": grid.pix_from_arcsec(rows["x_arcsec"], 0),
        "y_pix": grid.pix_from_arcsec(rows["y_arcsec"], 1),
        "offaxis_arcmin": sources.offaxis_arcmin,
        **{name: rows[name] for name in _COPIED},
        "counts_onaxis": counts_onaxis,
        "counts_expected": counts_onaxis * _mean_transmission(response, sources, rows["beta"]),
        "counts_drawn": drawn[:n],
    }
    images = [_image_truth(image, response, n + i, int(drawn[n + i])) for i, image in enumerate(sky.images)]
    return ArrayFrame.together([ArrayFrame(columns), *images])


def _mean_transmission(response: Response, sources: _Sources, beta: FloatArray) -> FloatArray:
    """Mean chance of a photon of each source to be observed, over the profile of the extended ones."""
    x_arcsec, y_arcsec, _, core_radius_arcsec, _ = sources.table.T
    mean = np.where(response.is_on_image(x_arcsec, y_arcsec), sources.seen_share, 0.0)
    for i in np.flatnonzero(core_radius_arcsec > 0.0):
        dx_arcsec, dy_arcsec = profile_directions(float(core_radius_arcsec[i]), float(beta[i]))
        mean[i] = response.transmission(x_arcsec[i] + dx_arcsec, y_arcsec[i] + dy_arcsec).mean()
    return mean


def _image_truth(image: SkyImage, response: Response, source_id: int, counts_drawn: int) -> ArrayFrame:
    """One truth row for a whole sky image."""
    ny, nx = image.rate_cps.shape
    x_arcsec = (np.arange(nx) - (nx - 1) / 2.0) * image.scale_arcsec
    y_arcsec = (np.arange(ny) - (ny - 1) / 2.0) * image.scale_arcsec
    observed_cps = float((image.rate_cps * response.transmission(x_arcsec[None, :], y_arcsec[:, None])).sum())
    rate_cps = float(image.rate_cps.sum())
    flux_per_rate_cgs = response.band.flux_per_rate_cgs
    numbers = {
        "source_id": source_id,
        "x_arcsec": 0.0,
        "y_arcsec": 0.0,
        "x_pix": response.grid.axis_pix[0],
        "y_pix": response.grid.axis_pix[1],
        "offaxis_arcmin": 0.0,
        "flux_cgs": np.nan if flux_per_rate_cgs is None else flux_from_rate(rate_cps, flux_per_rate_cgs),
        "rate_cps": rate_cps,
        "core_radius_arcsec": np.nan,
        "beta": np.nan,
        "redshift": np.nan,
        "group_id": -1,
        "group_sep_arcsec": np.nan,
        "counts_onaxis": rate_cps * response.exposure_s,
        "counts_expected": observed_cps * response.exposure_s,
        "counts_drawn": counts_drawn,
    }
    columns = {name: np.array([number]) for name, number in numbers.items()}
    return ArrayFrame({"kind": Texts.repeated("image", 1), **columns})
