"""Groups of bright Voronoi cells: are they more than the background makes, and where and how large are they.

Idea     a group of n photons on an area where the background expects μ is real if n, less μ, is at least the smallest
         number that the background exceeds with the tolerated probability; if not, its faintest cells are taken away
         until it is. Moments of the photons give position and ellipse.
Source   Ebeling & Wiedenmann 1993; the steps of CIAO's `vtpdetect` help page.
Limits   the group was chosen for its photons, so the probability of a false one is far above the tolerated one.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainc, gammaln, hyp1f1

from survey_mc.types import BoolArray, FloatArray

PIXEL_VARIANCE = 1.0 / 12.0  # pixel², of a photon known to its pixel only
TestedCounts = Literal["net", "total"]
LabelArray = NDArray[np.int32]


def minus_log_tail(counts: FloatArray, expected: FloatArray) -> FloatArray:
    """−ln P(≥ counts | expected) of a Poisson variable, counts > expected > 0, without underflow."""
    first = counts * np.log(expected) - expected - gammaln(counts + 1.0)
    return np.asarray(-(first + np.log(hyp1f1(1.0, counts + 1.0, expected))))


def exceeds_background(counts: FloatArray, expected: FloatArray, limit: float, tested: TestedCounts) -> BoolArray:
    """True where the counts reach the smallest number with P(≥ number | expected) ≤ limit."""
    number = np.floor(counts - expected) if tested == "net" else counts
    return np.asarray(gammainc(np.maximum(number, 1.0), expected) <= limit) & (number >= 1.0)


def group_sums(label: LabelArray, values: FloatArray) -> FloatArray:
    """Sum over each group's cells; label: −1 for cells of no group."""
    member = label >= 0
    sums = np.bincount(label[member], values[member], minlength=int(label.max(initial=-1)) + 1)
    return np.asarray(sums, dtype=np.float64)


def significant_groups(
    label: LabelArray,
    photons: FloatArray,
    expected: FloatArray,
    flux: FloatArray,
    limit: float,
    coarse: int,
    tested: TestedCounts,
) -> tuple[LabelArray, BoolArray]:
    """Label of each cell that remains in a significant group, renumbered from 0, and which groups were trimmed.

    Of an insignificant group the faintest cells, all of one flux at a time, are deleted until it is significant or has
    fewer than `coarse` photons.
    """
    counts = group_sums(label, photons)
    large = np.append(counts >= coarse, False)[label]  # −1, no group, finds the appended element
    cells = np.flatnonzero(large)
    label, photons, expected, flux = label[cells], photons[cells], expected[cells], flux[cells]
    whole = counts >= coarse
    background = np.bincount(label, expected, minlength=len(counts)).astype(np.float64)
    whole[whole] = exceeds_background(counts[whole], background[whole], limit, tested)
    kept = whole[label]
    order = np.flatnonzero(~kept)
    order = order[np.lexsort((-flux[order], label[order]))]
    if len(order):
        group = label[order]
        begins = np.append(True, group[1:] != group[:-1])
        n, mu = running_sum(photons[order], begins), running_sum(expected[order], begins)
        ends = np.append(begins[1:] | (flux[order][1:] < flux[order][:-1]), True)
        passes = np.flatnonzero(ends & (n >= coarse))
        passes = passes[exceeds_background(n[passes], mu[passes], limit, tested)]
        last = np.full(len(counts), -1)
        np.maximum.at(last, group[passes], passes)
        kept[order[np.arange(len(order)) <= last[group]]] = True
    left = np.bincount(label[kept], minlength=len(counts)) > 0
    result = np.full(len(large), -1, dtype=np.int32)
    result[cells[kept]] = (np.cumsum(left) - 1)[label[kept]]
    return result, ~whole[left]


def running_sum(values: FloatArray, begins: BoolArray) -> FloatArray:
    """Cumulative sum that starts again wherever `begins` is True (also at the first element)."""
    total = np.cumsum(values)
    before = (total - values)[begins]
    return np.asarray(total - before[np.cumsum(begins) - 1])


def moments(
    label: LabelArray, x: FloatArray, y: FloatArray, weight: FloatArray, photons: FloatArray, variance: float
) -> dict[str, FloatArray]:
    """Weighted mean position, its errors, and the second moments xx, yy, xy of each group.

    variance: of a photon's true place around its position, along each axis. A cell's weight is as uncertain as its
    photons make it.
    """
    total = group_sums(label, weight)
    mean_x, mean_y = group_sums(label, weight * x) / total, group_sums(label, weight * y) / total
    dx, dy = x - mean_x[label], y - mean_y[label]  # of no meaning where the label is −1, and not used there
    noise = np.square(weight) / photons
    return {
        "x": mean_x,
        "y": mean_y,
        "x_err": np.sqrt(group_sums(label, noise * (np.square(dx) + variance))) / total,
        "y_err": np.sqrt(group_sums(label, noise * (np.square(dy) + variance))) / total,
        "xx": group_sums(label, weight * np.square(dx)) / total + variance,
        "yy": group_sums(label, weight * np.square(dy)) / total + variance,
        "xy": group_sums(label, weight * dx * dy) / total,
    }


def ellipse(xx: FloatArray, yy: FloatArray, xy: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Semi-axes of one σ and the angle of the longer one, degrees from x towards y, 0 … 180."""
    half_sum, half_difference = 0.5 * (xx + yy), 0.5 * (xx - yy)
    spread = np.hypot(half_difference, xy)
    angle = 0.5 * np.degrees(np.arctan2(xy, half_difference)) % 180.0
    return np.sqrt(half_sum + spread), np.sqrt(np.maximum(half_sum - spread, 0.0)), angle


def half_counts_radius(label: LabelArray, distance: FloatArray, net: FloatArray) -> FloatArray:
    """Radius that holds half of each group's net counts; net: of each cell, ≥ 0."""
    member = np.flatnonzero(label >= 0)
    order = member[np.lexsort((distance[member], label[member]))]
    group = label[order]
    begins = np.append(True, group[1:] != group[:-1])
    reached = running_sum(net[order], begins) >= 0.5 * group_sums(label, net)[group]
    first = np.full(int(group[-1]) + 1, len(order) - 1)
    np.minimum.at(first, group[reached], np.flatnonzero(reached))
    return np.asarray(distance[order[first]])
