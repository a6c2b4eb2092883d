"""How much CPU time drawing a field takes: medians, run by hand.

    python benchmarks/bench_draw.py [--fields 30]

Each line draws random skies of logN-logS sources (default parameters) and exposes them, one core, after compilation.
"""

from __future__ import annotations

import argparse
import statistics
import time
from functools import partial

from survey_mc.rng import stream
from survey_mc.sky import SkyContext, draw_sky
from survey_mc.sky.lognlogs import LogNLogSParams
from survey_mc.telescope import InstrumentSettings
from survey_mc.telescope.expose import expose
from survey_mc.telescope.response import Response, build_response


def seconds_of_fields(response: Response, n_fields: int) -> tuple[list[float], list[float], int]:
    """Seconds of drawing each sky and of exposing it, and the photons of the last field."""
    sky_seconds, expose_seconds, n_photons = [], [], 0
    for number in range(n_fields):
        rng = partial(stream, f"bench{number}")
        start = time.process_time()
        sky = draw_sky(LogNLogSParams(), SkyContext(response.band, response.half_width_arcsec, rng, {}))
        middle = time.process_time()
        n_photons = len(expose(sky, response, rng, "bench").origin)
        expose_seconds.append(time.process_time() - middle)
        sky_seconds.append(middle - start)
    return sky_seconds, expose_seconds, n_photons


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fields", type=int, default=30, help="fields for each line")
    n_fields = parser.parse_args().fields
    print(f"{'band':5} {'ks':>4} {'photons':>8} {'sky ms':>7} {'expose ms':>9} {'both ms':>8} {'best ms':>8}")
    for band in ("soft", "hard"):
        for exposure_ks in (10.0, 100.0):
            response = build_response(InstrumentSettings(), band, 1000.0 * exposure_ks)
            seconds_of_fields(response, 2)
            sky, exposing, n_photons = seconds_of_fields(response, n_fields)
            both = [a + b for a, b in zip(sky, exposing, strict=True)]
            numbers = [1e3 * statistics.median(s) for s in (sky, exposing, both)] + [1e3 * min(both)]
            print(
                f"{band:5} {exposure_ks:4.0f} {n_photons:8d} {numbers[0]:7.2f} {numbers[1]:9.2f} "
                f"{numbers[2]:8.2f} {numbers[3]:8.2f}"
            )


if __name__ == "__main__":
    main()
