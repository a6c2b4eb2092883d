"""EMLDETECT on test fields: checked detections, matched to where sources were put."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from detect_fields import grid_positions, observe, photon_image

from survey_mc.detect import check_detections
from survey_mc.detect.emldetect import DETECTOR, EmldetectParams

RNG = np.random.default_rng(0)
PROFILES = ("paper", "modern")


def detections(image, profile="paper", exposure=None, psf=None, **changes):
    observation = observe(image, exposure)
    if psf is not None:
        observation = replace(observation, psf=psf)
    params = EmldetectParams(**{**DETECTOR.profiles[profile].model_dump(), **changes})
    return check_detections(DETECTOR, observation, DETECTOR.detect(observation, params, RNG))


def nearest(frame, positions):
    """Distance (pixels) from each position to the nearest detection, and that detection's row."""
    distance = np.hypot(
        frame["x_pix"].to_numpy()[:, None] - positions[:, 0], frame["y_pix"].to_numpy()[:, None] - positions[:, 1]
    )
    return distance.min(axis=0), distance.argmin(axis=0)


def isolated(counts, background, profile, seed, n_fields=1, **changes):
    """Offsets (x, y), counts and their errors of isolated points that are found."""
    rows = []
    for field in range(n_fields):
        rng = np.random.default_rng([seed, field])
        positions = grid_positions(8, 512, rng)
        frame = detections(photon_image(rng, background, [(x, y, counts) for x, y in positions]), profile, **changes)
        distance, row = nearest(frame, positions)
        near = distance < 2.5
        found = frame.iloc[row[near]]
        offset = found[["x_pix", "y_pix"]].to_numpy() - positions[near]
        rest = found[["x_err_pix", "counts", "counts_err", "EXT"]].to_numpy()
        rows.append(np.concatenate([offset, rest], axis=1))
    return np.concatenate(rows)
