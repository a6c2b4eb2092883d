"""Seconds of every step of the mixed procedures on one 512 × 512 field, one core.

Run      python benchmarks/bench_detect.py [--repeats N]
Limits   medians and minima of CPU time after compilation; the field is a power law of point sources on a flat sky.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from survey_mc.detect import DETECTORS, gauss_se, mr1_se
from survey_mc.detect._mr1 import atrous
from survey_mc.detect._mr1 import filter as mr1
from survey_mc.detect._mr1.few_event import abaque
from survey_mc.detect._sextractor import catalogue, sep_chain
from survey_mc.detect._shared import observed, smoothing
from survey_mc.types import Band, FloatArray, Observation, PixelGrid

N_PIX = 512
SCALE_ARCSEC = 4.0
FAINTEST_COUNTS = {10: 4.0, 100: 24.0}  # of 1200 sources, N(> counts) ∝ counts^−1.2
BACKGROUND_PER_PIX = {10: 0.178, 100: 1.78}
KING_CORE_PIX, KING_SLOPE = 0.953, 1.4377


class Psf:
    """The King profile of the field."""

    fwhm_arcsec, hew_arcsec = 6.0, 15.0

    def encircled_energy(self, radius_arcsec: FloatArray) -> FloatArray:
        x2 = np.square(np.asarray(radius_arcsec) / (KING_CORE_PIX * SCALE_ARCSEC))
        return np.asarray(1.0 - (1.0 + x2) ** (1.0 - KING_SLOPE))

    def surface_brightness(self, radius_arcsec: FloatArray) -> FloatArray:
        x2 = np.square(np.asarray(radius_arcsec) / (KING_CORE_PIX * SCALE_ARCSEC))
        return np.asarray((1.0 + x2) ** -KING_SLOPE)


def draw(exposure_ks: int) -> Observation:
    """A field of point sources on a flat sky."""
    rng = np.random.default_rng(exposure_ks)
    counts = rng.poisson(BACKGROUND_PER_PIX[exposure_ks], (N_PIX, N_PIX)).astype(np.int32)
    bright = FAINTEST_COUNTS[exposure_ks] * (1.0 - rng.random(1200)) ** (-1.0 / 1.2)
    for expected in np.minimum(bright, 1e4):
        n = rng.poisson(expected)
        radius = KING_CORE_PIX * np.sqrt((1.0 - rng.random(n)) ** (1.0 / (1.0 - KING_SLOPE)) - 1.0)
        angle = 2.0 * np.pi * rng.random(n)
        x, y = rng.uniform(0, N_PIX - 1, 2)
        column, row = np.rint(x + radius * np.cos(angle)), np.rint(y + radius * np.sin(angle))
        inside = (column >= 0) & (column < N_PIX) & (row >= 0) & (row < N_PIX)
        np.add.at(counts, (row[inside].astype(int), column[inside].astype(int)), 1)
    exposure_s = np.full(counts.shape, exposure_ks * 1e3)
    return Observation(
        counts, None, exposure_s, None, Psf(), PixelGrid.centred(N_PIX, SCALE_ARCSEC), Band("soft", 0.5, 2.0, 6.7e-13)
    )


def report(step: str, repeats: int, work: Callable[[], object]) -> None:
    """Print the median and the smallest CPU time of a step."""
    work()
    seconds = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    print(f"  {step:<46}{1e3 * np.median(seconds):8.1f} ms   (least {1e3 * min(seconds):.1f})")


def bench(exposure_ks: int, repeats: int) -> None:
    """All steps on one field."""
    observation = draw(exposure_ks)
    seen = observed.observed_pixels(observation)
    photons = observation.counts.astype(np.float64)
    paper, rng = mr1_se.PAPER, np.random.default_rng(0)
    print(f"{exposure_ks} ks, {observation.counts.sum()} photons")
    report("Gaussian smoothing, 12″", repeats, lambda: smoothing.smooth(photons, 1.274))
    projected = mr1.project(photons, "mirror")
    work = atrous.Workspace.of(projected.shape, 6)
    report("MR/1: projection", repeats, lambda: mr1.project(photons, "mirror"))
    report("à trous, 6 planes", repeats, lambda: atrous.transform(projected, work, atrous.BORDER_MIRROR))
    report("MR/1: support", repeats, lambda: mr1.significant(projected, photons, paper))
    report("MR/1: whole filter, 25 iterations", repeats, lambda: mr1.restore(photons, paper))
    for module in (gauss_se, mr1_se):
        params = module.PAPER
        search = module.search_image(observation, params, seen)
        signal = np.ascontiguousarray(search.filtered - search.background)
        found = sep_chain.extract(signal, search.threshold, search.masked, params)
        name = module.DETECTOR.name
        raw = observation.counts.astype(np.float32)
        print(f" {name}: {len(found.objects)} detections")
        report("search image", repeats, lambda m=module, p=params: m.search_image(observation, p, seen))
        report("sep background", repeats, lambda s=search, p=params: sep_chain.mesh_background(s.filtered, s.masked, p))
        report(
            "sep extraction, 64 levels, contrast 0",
            repeats,
            lambda s=search, d=signal, p=params: sep_chain.extract(d, s.threshold, s.masked, p),
        )
        report(
            "Kron and R50 photometry",
            repeats,
            lambda s=search, d=signal, f=found, p=params, r=raw: catalogue.aperture_values(d, d, r, s.masked, f, p),
        )
        report(
            "position errors",
            repeats,
            lambda s=search, d=signal, f=found: catalogue.barycentre_variances(s, d, f),
        )
        report(f"{name}, end to end", repeats, lambda n=name, p=params: DETECTORS[n].detect(observation, p, rng))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=11, help="timed runs of each step")
    repeats = parser.parse_args().repeats
    start = time.process_time()
    abaque.cache_clear()
    abaque(1e-4)
    print(f"few-event table: {1e3 * (time.process_time() - start):.0f} ms, once a process")
    for exposure_ks in (10, 100):
        bench(exposure_ks, repeats)


if __name__ == "__main__":
    main()
