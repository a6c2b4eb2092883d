"""Seconds of all procedures, and of their steps, on one 512 × 512 field, one core.

Run      OMP_NUM_THREADS=1 python benchmarks/bench_detect.py [--repeats N] [--method NAME] [--steps] [--crowded]
Limits   CPU time after compilation, medians and minima; a soft field of `test5_completeness` with another seed, or
         (--crowded) a power law of point sources on a flat sky without vignetting.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy import fft

from survey_mc.campaign import draw_field, expand, parse_campaign
from survey_mc.detect import DETECTORS, gauss_se, mr1_se
from survey_mc.detect._eml.cheese_spline import background_map
from survey_mc.detect._eml.sliding_cell import sliding_cell
from survey_mc.detect._mr1 import atrous
from survey_mc.detect._mr1 import filter as mr1
from survey_mc.detect._mr1.few_event import abaque
from survey_mc.detect._sextractor import catalogue, sep_chain
from survey_mc.detect._shared import observed, smoothing
from survey_mc.types import Band, FloatArray, Observation, PixelGrid

CAMPAIGN = Path(__file__).parents[1] / "campaigns" / "test5_completeness.toml"
SEED, TRAINING_SEED = "seed = 20010208", "seed = 77"
N_PIX = 512
SCALE_ARCSEC = 4.0
FAINTEST_COUNTS = {10: 4.0, 100: 24.0}  # of 1200 sources, N(> counts) ∝ counts^−1.2
BACKGROUND_PER_PIX = {10: 0.178, 100: 1.78}
KING_CORE_PIX, KING_SLOPE = 0.953, 1.4377
PADDED = 600  # length of the transforms of the wavelets


class Psf:
    """The King profile of the field."""

    fwhm_arcsec, hew_arcsec = 6.0, 15.0
    _core_arcsec = KING_CORE_PIX * SCALE_ARCSEC

    def encircled_energy(self, radius_arcsec: FloatArray) -> FloatArray:
        x2 = np.square(np.asarray(radius_arcsec) / self._core_arcsec)
        return np.asarray(1.0 - (1.0 + x2) ** (1.0 - KING_SLOPE))

    def surface_brightness(self, radius_arcsec: FloatArray) -> FloatArray:
        x2 = np.square(np.asarray(radius_arcsec) / self._core_arcsec)
        return np.asarray((KING_SLOPE - 1.0) / (np.pi * self._core_arcsec**2) * (1.0 + x2) ** -KING_SLOPE)


def draw(exposure_ks: int) -> Observation:
    """A soft field as Test 5 has them."""
    campaign = parse_campaign(CAMPAIGN.read_text().replace(SEED, TRAINING_SEED))
    cells = expand(campaign)
    cell = next(c for c in cells if c.band == "soft" and c.exposure_ks == exposure_ks)
    return draw_field(campaign, cell, 0).observation


def draw_crowded(exposure_ks: int) -> Observation:
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


def report(step: str, repeats: int, work: Callable[[], object]) -> float:
    """Print the median and the smallest CPU time of a step; the median in seconds."""
    work()
    seconds = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    print(f"  {step:<46}{1e3 * np.median(seconds):8.1f} ms   (least {1e3 * min(seconds):.1f})")
    return float(np.median(seconds))


def bench_procedures(observation: Observation, names: tuple[str, ...], repeats: int) -> None:
    """Every procedure end to end in its profiles "paper" and "modern"."""
    rng = np.random.default_rng(0)
    total = {"paper": 0.0, "modern": 0.0}
    for name in names:
        detector = DETECTORS[name]
        for profile in total:
            params = detector.profiles[profile]
            n = len(detector.detect(observation, params, rng))
            title = f"{name}, {profile}: {n} detections"
            total[profile] += report(title, repeats, lambda d=detector, p=params: d.detect(observation, p, rng))
    for profile, seconds in total.items():
        print(f"  {'all, ' + profile:<46}{1e3 * seconds:8.1f} ms")


def bench_steps(observation: Observation, repeats: int) -> None:
    """The steps of the procedures, and what the arithmetic costs."""
    seen = observed.observed_pixels(observation)
    photons = observation.counts.astype(np.float64)
    single = np.zeros((PADDED, PADDED), dtype=np.float32)
    light = fft.rfft2(single)
    report("one inverse transform, 600², single precision", repeats, lambda: fft.irfft2(light, s=single.shape))
    report("Gaussian smoothing, 12″", repeats, lambda: smoothing.smooth(photons, 1.274))
    bench_mr1(photons, repeats)
    bench_eml(observation, repeats)
    for module in (gauss_se, mr1_se):
        bench_sextractor(observation, module, seen, repeats)


def bench_mr1(photons: FloatArray, repeats: int) -> None:
    """Steps of the MR/1 filter."""
    paper = mr1_se.PAPER
    projected = mr1.project(photons, "mirror")
    work = atrous.Workspace.of(projected.shape, 6)
    report("MR/1: projection", repeats, lambda: mr1.project(photons, "mirror"))
    report("à trous, 6 planes", repeats, lambda: atrous.transform(projected, work, atrous.BORDER_MIRROR))
    report("MR/1: support", repeats, lambda: mr1.significant(projected, photons, paper))
    report("MR/1: whole filter, 25 iterations", repeats, lambda: mr1.restore(photons, paper))


def bench_eml(observation: Observation, repeats: int) -> None:
    """Stages of EMLDETECT before the fits."""
    params = DETECTORS["emldetect"].profiles["paper"]
    cells = sliding_cell(observation, None, params)
    background = background_map(observation, cells, params)
    found = sliding_cell(observation, background, params)
    report("sliding cell, local", repeats, lambda: sliding_cell(observation, None, params))
    report("background of the cheese image", repeats, lambda: background_map(observation, cells, params))
    title = f"sliding cell, map: {len(found.x_pix)} candidates"
    report(title, repeats, lambda: sliding_cell(observation, background, params))


def bench_sextractor(observation: Observation, module: object, seen: object, repeats: int) -> None:
    """Steps of a mixed procedure."""
    params = module.PAPER
    search = module.search_image(observation, params, seen)
    signal = np.ascontiguousarray(search.filtered - search.background)
    found = sep_chain.extract(signal, search.threshold, search.masked, params)
    raw = observation.counts.astype(np.float32)
    name = module.DETECTOR.name
    report(f"{name}: search image", repeats, lambda: module.search_image(observation, params, seen))
    report(
        f"{name}: sep background",
        repeats,
        lambda: sep_chain.mesh_background(search.filtered, search.masked, params),
    )
    report(
        f"{name}: sep extraction, 64 levels, contrast 0",
        repeats,
        lambda: sep_chain.extract(signal, search.threshold, search.masked, params),
    )
    report(
        f"{name}: Kron and R50 photometry",
        repeats,
        lambda: catalogue.aperture_values(signal, signal, raw, search.masked, found, params),
    )
    report(f"{name}: position errors", repeats, lambda: catalogue.barycentre_variances(search, signal, found))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=11, help="timed runs of each step")
    parser.add_argument("--method", action="append", help="procedures to time; all unless given")
    parser.add_argument("--steps", action="store_true", help="also the steps of the procedures")
    parser.add_argument("--crowded", action="store_true", help="a field with more sources")
    given = parser.parse_args()
    names = tuple(given.method or [detector.name for detector in DETECTORS.built_in])
    start = time.process_time()
    abaque.cache_clear()
    abaque(1e-4)
    print(f"few-event table: {1e3 * (time.process_time() - start):.0f} ms, once a process")
    for exposure_ks in (10, 100):
        observation = draw_crowded(exposure_ks) if given.crowded else draw(exposure_ks)
        print(f"{exposure_ks} ks, {observation.counts.sum()} photons")
        bench_procedures(observation, names, given.repeats)
        if given.steps:
            bench_steps(observation, given.repeats)


if __name__ == "__main__":
    main()
