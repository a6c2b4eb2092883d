"""Small fields and catalogues for the tests of matching, and hypothesis strategies that draw them."""

from __future__ import annotations

import numpy as np
import pandas as pd
from hypothesis import strategies as st

from survey_mc.array_frame import ArrayFrame
from survey_mc.columns import DETECTIONS, TRUTH
from survey_mc.types import Band, Field, Observation, PixelGrid

SCALE_ARCSEC = 4.0
N_PIX = 64


def truth_frame(x_pix, y_pix, counts, kind="point", grid=None):
    grid = grid or PixelGrid.centred(N_PIX, SCALE_ARCSEC)
    x_pix, y_pix, counts = (np.asarray(v, dtype=float) for v in (x_pix, y_pix, counts))
    values = {
        "source_id": np.arange(len(x_pix), dtype=np.int32),
        "kind": np.broadcast_to(np.array(kind, dtype=object), len(x_pix)),
        "x_pix": x_pix,
        "y_pix": y_pix,
        "offaxis_arcmin": grid.offaxis_arcmin(x_pix, y_pix),
        "flux_cgs": counts * 1e-16,
        "counts_onaxis": counts,
        "counts_expected": counts,
        "counts_drawn": counts.astype(np.int32),
        "group_id": np.full(len(x_pix), -1, dtype=np.int32),
    }
    return pd.DataFrame({n: values.get(n, np.full(len(x_pix), np.nan)) for n in TRUTH.names if n != "realisation"})


def detection_frame(x_pix, y_pix, r50_arcsec=np.nan, det_id=None, grid=None):
    grid = grid or PixelGrid.centred(N_PIX, SCALE_ARCSEC)
    x_pix, y_pix = np.asarray(x_pix, dtype=float), np.asarray(y_pix, dtype=float)
    values = {
        "det_id": np.arange(len(x_pix), dtype=np.int32) if det_id is None else np.asarray(det_id, dtype=np.int32),
        "x_pix": x_pix,
        "y_pix": y_pix,
        "offaxis_arcmin": grid.offaxis_arcmin(x_pix, y_pix),
        "counts": np.full(len(x_pix), 20.0),
        "significance": np.full(len(x_pix), 5.0),
        "r50_arcsec": np.broadcast_to(np.asarray(r50_arcsec, dtype=float), len(x_pix)),
        "flags": np.zeros(len(x_pix), dtype=np.int32),
    }
    names = [n for n in DETECTIONS.names if n != "realisation"]
    return pd.DataFrame({n: values.get(n, np.full(len(x_pix), np.nan)) for n in names})


def field_of(truth, photons, background_per_pix=0.05, n_pix=N_PIX):
    """A field with the given photons: rows (x_pix, y_pix, source_id), -1 = background."""
    photons = np.asarray(photons, dtype=float).reshape(-1, 3)
    inside = (np.abs(photons[:, :2] - (n_pix - 1) / 2) < n_pix / 2).all(axis=1)
    photons = photons[inside]
    column, row = np.floor(photons[:, 0] + 0.5).astype(int), np.floor(photons[:, 1] + 0.5).astype(int)
    pixel = row * n_pix + column
    order = np.lexsort((photons[:, 0], pixel))
    counts = np.bincount(pixel, minlength=n_pix * n_pix)
    observation = Observation(
        counts=counts.reshape(n_pix, n_pix).astype(np.int32),
        photons_pix=np.ascontiguousarray(photons[order, :2]),
        exposure_s=np.full((n_pix, n_pix), 1e4),
        background=None,
        psf=None,
        grid=PixelGrid.centred(n_pix, SCALE_ARCSEC),
        band=Band("soft", 0.5, 2.0, 6.7e-13),
    )
    return Field(
        key="test",
        truth_rows=ArrayFrame.of_frame(truth),
        origin=photons[order, 2].astype(np.int32),
        row_start=np.concatenate(([0], np.cumsum(counts)[n_pix - 1 :: n_pix])).astype(np.int64),
        background_expected=np.full((n_pix, n_pix), background_per_pix),
        observation=observation,
    )


def photons_of(truth, rng, sigma_pix=0.8, n_background=0, n_pix=N_PIX):
    """Gaussian photons of every source, counts_drawn each, and uniform background."""
    parts = [
        np.column_stack((rng.normal(s.x_pix, sigma_pix, s.counts_drawn), rng.normal(s.y_pix, sigma_pix, s.counts_drawn),
                         np.full(s.counts_drawn, s.source_id)))
        for s in truth.itertuples()
    ]  # fmt: skip
    flat = rng.uniform(-0.5, n_pix - 0.5, (n_background, 2))
    parts.append(np.column_stack((flat, np.full(n_background, -1))))
    return np.concatenate(parts)


@st.composite
def fields_and_detections(draw):
    """A field of up to 25 sources, some near each other, and detections on, near and far from them."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n_sources, n_detections = draw(st.integers(0, 25)), draw(st.integers(0, 25))
    x, y = rng.uniform(5, N_PIX - 6, (2, n_sources))
    if n_sources > 4:
        x[:2], y[:2] = x[2:4] + 1.0, y[2:4] + 0.5
    truth = truth_frame(x, y, rng.integers(1, 60, n_sources))
    field = field_of(truth, photons_of(truth, rng, n_background=draw(st.integers(0, 400))), 0.1)
    dx, dy = rng.uniform(5, N_PIX - 6, (2, n_detections))
    near = rng.random(n_detections) < 0.7 if n_sources else np.zeros(n_detections, dtype=bool)
    whose = rng.integers(0, max(n_sources, 1), n_detections)
    dx[near] = x[whose[near]] + rng.normal(0, 1.0, near.sum())
    dy[near] = y[whose[near]] + rng.normal(0, 1.0, near.sum())
    r50 = np.where(rng.random(n_detections) < 0.5, np.nan, rng.uniform(2, 40, n_detections))
    return field, detection_frame(dx, dy, r50)
