"""How well a statistic separates two kinds of sources: the area under the ROC curve."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from survey_mc.stats.classification import auc
from survey_mc.types import BoolArray, FloatArray


class Separation(NamedTuple):
    """auc: probability that a point scores higher than an extended source (½: no use); err: its standard error."""

    auc: float
    err: float
    n_points: int
    n_extended: int

    def __str__(self) -> str:
        return f"AUC {self.auc:.4f} ± {self.err:.4f} ({self.n_points} points, {self.n_extended} extended)"


def separation(score: FloatArray, is_point: BoolArray) -> Separation:
    """Area under the ROC curve of a score (larger: point), ties counted half; NaN without sources of both kinds.

    The error is that of Hanley & McNeil 1982 Radiology 143, 29.
    """
    n, m = int(is_point.sum()), int((~is_point).sum())
    if n == 0 or m == 0:
        return Separation(np.nan, np.nan, n, m)
    area = auc(score, ~is_point, larger_is_extended=False)
    two_points, two_extended = area / (2.0 - area), 2.0 * area**2 / (1.0 + area)
    variance = area * (1.0 - area) + (n - 1) * (two_points - area**2) + (m - 1) * (two_extended - area**2)
    return Separation(area, float(np.sqrt(max(variance, 0.0) / (n * m))), n, m)
