"""CPU time of `match_field` on a field like the paper's 100 ks soft one: 3200 true sources, 150 detections.

Run by hand: python benchmarks/bench_match.py
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from survey_mc.match import MatchParams, match_field
from survey_mc.types import PixelGrid

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "match"))
from match_fields import detection_frame, field_of, photons_of, truth_frame

N_PIX, N_SOURCES, N_DETECTIONS, N_BACKGROUND, N_REPEATS = 512, 3200, 150, 467_000, 200


def main() -> None:
    rng = np.random.default_rng(1)
    grid = PixelGrid.centred(N_PIX, 4.0)
    counts = np.minimum(15.0 * rng.pareto(1.5, N_SOURCES) + 15.0, 20_000.0)
    truth = truth_frame(*rng.uniform(0, N_PIX - 1, (2, N_SOURCES)), counts, grid=grid)
    field = field_of(truth, photons_of(truth, rng, 1.0, N_BACKGROUND, N_PIX), N_BACKGROUND / N_PIX**2, N_PIX)
    bright = truth.nlargest(N_DETECTIONS, "counts_expected")
    x, y = (bright[name].to_numpy() + rng.normal(0, 0.3, N_DETECTIONS) for name in ("x_pix", "y_pix"))
    detections = detection_frame(x, y, rng.uniform(5, 30, N_DETECTIONS), grid=grid)
    for assignment in ("nearest_from_detection", "mutual", "one_to_one"):
        params = MatchParams(assignment=assignment)
        match_field(field, detections, params, 30.0)
        times_ms = []
        for _ in range(N_REPEATS):
            start = time.process_time()
            matched = match_field(field, detections, params, 30.0)
            times_ms.append(1e3 * (time.process_time() - start))
        print(
            f"{assignment:24s} median {np.median(times_ms):.2f} ms, least {min(times_ms):.2f} ms "
            f"({len(matched.matches)} rows, {len(matched.links)} links)"
        )


if __name__ == "__main__":
    main()
