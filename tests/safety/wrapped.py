"""A program of others as a detector: an image in, a catalogue out."""

import csv
import io

import numpy as np
from astropy.io import fits
from pydantic import Field

from survey_mc.detect import Detector, DetectorParams, detections_frame
from survey_mc.external import run_program

PROGRAM = "brightpix"  # fixed here: a campaign may set numbers, never what is executed


class BrightPixParams(DetectorParams):
    counts_min: int = Field(6, ge=1, le=10_000, description="least photons of a pixel (counts)")
    timeout_s: float = Field(60.0, gt=0.0, le=3600.0, description="wall time allowed for one image (s)")


def detect(obs, params, rng):
    image = io.BytesIO()
    fits.PrimaryHDU(obs.counts).writeto(image)
    argv = [PROGRAM, "image.fits", "found.csv", f"--counts-min={params.counts_min}"]
    result = run_program(
        argv, files_in={"image.fits": image.getvalue()}, wanted=["found.csv"], timeout_s=params.timeout_s
    )
    rows = list(csv.DictReader(io.StringIO(result.files["found.csv"].decode("ascii"))))
    x, y, n = (np.array([float(row[name]) for row in rows]) for name in ("X", "Y", "COUNTS"))
    error = np.full(len(rows), 0.5)
    values = {"x_pix": x - 1.0, "y_pix": y - 1.0, "x_err_pix": error, "y_err_pix": error, "counts": n,
              "counts_err": np.sqrt(n), "background_per_pix": 0.0 * n, "significance": np.sqrt(n),
              "r50_arcsec": np.nan * n, "flags": np.zeros(len(rows), dtype=int)}  # fmt: skip
    return detections_frame(obs, values, extra_columns=())


PAPER = BrightPixParams()
DETECTOR = Detector(
    "brightpix", "Bright pixels", 1, "pixels with many photons", "Someone 1999, AJ 1, 1", BrightPixParams, detect,
    tiny=PAPER, profiles={"paper": PAPER},
)  # fmt: skip
