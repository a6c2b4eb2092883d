"""Small FITS files, good and bad, made with astropy (the independent program of these tests)."""

import gzip
from dataclasses import dataclass

import numpy as np
import pandas as pd
from astropy.io import fits

from survey_mc.array_frame import ArrayFrame
from survey_mc.columns import DETECTIONS, TRUTH
from survey_mc.types import Band, Field, Observation, PixelGrid

SHAPE = (24, 32)
SCALE_ARCSEC = 4.0


@dataclass(frozen=True)
class SamplePsf:
    fwhm_arcsec: float = 6.0
    hew_arcsec: float = 15.0

    def encircled_energy(self, radius_arcsec):
        return 1.0 - 0.5 ** ((radius_arcsec / 7.5) ** 2)

    def surface_brightness(self, radius_arcsec):
        return np.exp(-(radius_arcsec**2))


def sample_counts(shape=SHAPE):
    return np.random.default_rng(7).poisson(0.8, shape).astype(np.int32)


def sky_header(shape=SHAPE, scale_arcsec=SCALE_ARCSEC, rotation_deg=0.0, mirrored=False, style="CD", **cards):
    """A tangent-plane header around RA 150.1, Dec 2.2."""
    scale_deg, turn = scale_arcsec / 3600.0, np.radians(rotation_deg)
    flip = 1.0 if mirrored else -1.0
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ np.diag([flip, 1.0])
    header = fits.Header({"CTYPE1": "RA---TAN", "CTYPE2": "DEC--TAN", "CRVAL1": 150.1, "CRVAL2": 2.2})
    header.update({"CRPIX1": shape[1] / 2 + 0.5, "CRPIX2": shape[0] / 2 + 0.5, "CUNIT1": "deg", "CUNIT2": "deg"})
    header["RADESYS"] = "ICRS"
    for i in (1, 2):
        if style == "PC":
            header[f"CDELT{i}"] = scale_deg
        for j in (1, 2):
            header[f"{style}{i}_{j}"] = matrix[i - 1, j - 1] * (1.0 if style == "PC" else scale_deg)
    header.update(cards)
    return header


def write_image(path, values=None, header=None, *, packed=False, checksum=False, extension=False):
    """A file with one image; values default to `sample_counts`, the header to `sky_header`."""
    values = sample_counts() if values is None else np.asarray(values)
    header = sky_header(values.shape[-2:]) if header is None else header
    units = (
        [fits.PrimaryHDU(), fits.ImageHDU(values, header, name="SCI")]
        if extension
        else [fits.PrimaryHDU(values, header)]
    )
    fits.HDUList(units).writeto(path, checksum=checksum, overwrite=True)
    if packed:
        path.write_bytes(gzip.compress(path.read_bytes(), mtime=0))
    return path


def sample_observation(grid=None, flux_per_rate_cgs=1e-11):
    grid = grid or PixelGrid(SHAPE, SCALE_ARCSEC, (15.5, 11.5))
    exposure_s = np.full(grid.shape, 1e4)
    return Observation(
        sample_counts(grid.shape), None, exposure_s, None, SamplePsf(), grid, Band("soft", 0.5, 2.0, flux_per_rate_cgs)
    )


def sample_truth(grid, x_pix, y_pix):
    """Truth of point sources at pixel positions."""
    x_pix, y_pix = np.asarray(x_pix, dtype=float), np.asarray(y_pix, dtype=float)
    n = len(x_pix)
    values = {
        column.name: {"float64": np.nan, "int32": -1, "string": "point"}[column.dtype] for column in TRUTH.columns
    }
    frame = pd.DataFrame({name: [value] * n for name, value in values.items() if name != "realisation"})
    return frame.assign(
        source_id=np.arange(n, dtype=np.int32),
        x_pix=x_pix,
        y_pix=y_pix,
        x_arcsec=(x_pix - grid.axis_pix[0]) * grid.scale_arcsec,
        y_arcsec=(y_pix - grid.axis_pix[1]) * grid.scale_arcsec,
    )


def sample_field(shape=SHAPE, n_photons=500):
    """A field with two sources; every fifth photon is of source 1, the rest background."""
    grid = PixelGrid(shape, SCALE_ARCSEC, ((shape[1] - 1) / 2.0, (shape[0] - 1) / 2.0))
    rng = np.random.default_rng(3)
    x_cell, y_cell = rng.integers(0, shape[1], n_photons), rng.integers(0, shape[0], n_photons)
    x_pix = x_cell + rng.uniform(-0.4, 0.4, n_photons)
    order = np.lexsort((x_pix, x_cell, y_cell))
    photons_pix = np.column_stack([x_pix, y_cell + rng.uniform(-0.4, 0.4, n_photons)])[order]
    counts = np.zeros(shape, dtype=np.int32)
    np.add.at(counts, (y_cell, x_cell), 1)
    observation = Observation(
        counts, photons_pix, np.full(shape, 1e4), None, SamplePsf(), grid, Band("soft", 0.5, 2.0, 6.7e-13)
    )
    origin = np.where(np.arange(n_photons) % 5 == 0, 1, -1).astype(np.int32)
    row_start = np.concatenate([[0], np.cumsum(counts.sum(axis=1))]).astype(np.int64)
    truth = sample_truth(grid, [5.0, 20.25], [6.0, 17.5])
    return Field("5f3c", ArrayFrame.of_frame(truth), origin, row_start, np.full(shape, 0.25), observation)


def sample_detections(x_pix, y_pix, **columns):
    """A frame as a detector returns it."""
    n = len(x_pix)
    fill = {"int32": 0, "float64": np.nan}
    frame = pd.DataFrame({c.name: [fill[c.dtype]] * n for c in DETECTIONS.columns if c.name != "realisation"})
    frame = frame.astype({c.name: c.dtype for c in DETECTIONS.columns if c.name != "realisation"})
    return frame.assign(
        det_id=np.arange(n, dtype=np.int32), x_pix=np.asarray(x_pix, float), y_pix=np.asarray(y_pix, float), **columns
    )
