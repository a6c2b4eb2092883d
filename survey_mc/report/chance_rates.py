"""Chance matches of one cell and method by the nearest rule, from catalogues turned about the optical axis.

Idea     the first fields of a run are enough; their listed sources are kept, the detections stream by.
Limits   a field without a listed source and without a detection is not seen. Turned are all detections, and those
         alone that no source has; only the latter can claim a lost source, so they correct the completeness.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from survey_mc.match.chance import N_ROTATIONS, chance_probability, count_claims, rotated_claims
from survey_mc.report.pieces import Joined
from survey_mc.report.source import CellLike
from survey_mc.rng import stream
from survey_mc.stats.classification import rate_of
from survey_mc.stats.resampling import field_weights
from survey_mc.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

N_FIELDS_TURNED = 200
ALL, UNMATCHED = "all", "unmatched"
PLACE_COLUMNS = ("x_pix", "y_pix")  # of detections
TRUTH_COLUMNS = ("realisation", "kind", "x_arcsec", "y_arcsec", "x_pix", "y_pix", "offaxis_arcmin")


@dataclass(frozen=True, slots=True)
class Plane:
    """Optical axis and scale of the image."""

    axis_pix: tuple[float, float]
    scale_arcsec: float


@dataclass(slots=True)
class ListedSources:
    """Offsets (arcsec) of the input list of the first fields, and whether each source is in the region."""

    cell: CellLike
    counts_column: str = "counts_expected"
    plane: Plane | None = None
    by_field: dict[int, tuple[FloatArray, BoolArray]] = field(default_factory=dict)
    is_complete: bool = False

    def add(self, truth: DataFrame) -> None:
        """Add a piece of the truth; `is_complete` after one beyond the fields that are turned."""
        is_turned = truth["realisation"].to_numpy(np.int64) < N_FIELDS_TURNED
        self.is_complete = not is_turned.all()
        truth = truth[is_turned]
        offsets = truth[["x_arcsec", "y_arcsec"]].to_numpy(np.float64)
        has_place = np.isfinite(offsets).all(axis=1) & np.asarray(truth["kind"].array != "image", dtype=bool)
        if self.plane is None:
            self.plane = _plane_of(truth[has_place])
        is_listed = has_place & (truth[self.counts_column].to_numpy(np.float64) >= self.cell.counts_min)
        inside = truth["offaxis_arcmin"].to_numpy(np.float64) <= self.cell.region_arcmin
        realisation = truth["realisation"].to_numpy(np.int64)
        for number in np.unique(realisation):
            rows = is_listed & (realisation == number)
            self.by_field[int(number)] = (offsets[rows], inside[rows])


def _plane_of(truth: DataFrame) -> Plane | None:
    """The image's geometry from two sources whose place is known in both units; None without them."""
    if len(truth) < 2:
        return None
    x, x_pix, y, y_pix = (truth[name].to_numpy(np.float64) for name in ("x_arcsec", "x_pix", "y_arcsec", "y_pix"))
    first, last = int(np.argmin(x)), int(np.argmax(x))
    if not x_pix[last] > x_pix[first]:
        return None
    scale = float((x[last] - x[first]) / (x_pix[last] - x_pix[first]))
    return Plane((float(x_pix[first] - x[first] / scale), float(y_pix[first] - y[first] / scale)), scale)


@dataclass(slots=True)
class ChanceSums:
    """Numbers of each turned field: (n_found, n_tried, n_claimed, n_sources) by catalogue."""

    listed: ListedSources
    numbers: dict[str, list[tuple[int, int, int, int]]] = field(default_factory=lambda: {ALL: [], UNMATCHED: []})

    def add(self, joined: Joined) -> None:
        """Add the rows of the nearest rule."""
        plane, cell = self.listed.plane, self.listed.cell
        realisation = joined.matches.integers("realisation")
        if plane is None or not len(realisation) or int(realisation[0]) >= N_FIELDS_TURNED:
            return
        offsets = np.column_stack(
            [(joined.of_detection(f"{i}_pix") - plane.axis_pix[k]) * plane.scale_arcsec for k, i in enumerate("xy")]
        )
        is_there = np.isfinite(offsets).all(axis=1)
        inside = joined.matches.numbers("offaxis_arcmin") <= cell.region_arcmin
        is_free = ~joined.matches.has("status", "matched")
        for number in np.unique(realisation[realisation < N_FIELDS_TURNED]):
            if int(number) not in self.listed.by_field:
                continue
            sources, source_inside = self.listed.by_field[int(number)]
            rows = is_there & (realisation == number)
            claims = rotated_claims(offsets[rows], sources, cell.radius_arcsec)
            for name, takes_part in ((ALL, np.ones(int(rows.sum()), dtype=bool)), (UNMATCHED, is_free[rows])):
                n = count_claims(claims, takes_part, inside[rows], source_inside)
                self.numbers[name].append((n.n_found, n.n_tried, n.n_claimed, n.n_sources))

    def table(self) -> DataFrame:
        """A row for each catalogue and question: of detections, and of sources; no rows without any field."""
        import pandas as pd

        rows = []
        area_deg2 = self.listed.cell.region_deg2
        for catalogue, fields in self.numbers.items():
            if not fields:
                continue
            n = np.asarray(fields, dtype=np.int64)
            weights = field_weights(len(n), stream(self.listed.cell.label, "turned fields"))
            per_deg2 = n.sum(axis=0) / (N_ROTATIONS * len(n) * area_deg2)
            for of, found, tried, others in (("detections", 0, 1, 3), ("sources", 2, 3, 1)):
                rows.append(
                    {
                        "catalogue": catalogue,
                        "of": of,
                        "n_fields_turned": len(n),
                        "n_rotations": N_ROTATIONS,
                        "radius_arcsec": self.listed.cell.radius_arcsec,
                        **_rate(n[:, found], n[:, tried], weights),
                        "density_per_deg2": per_deg2[others],
                        "closed_form": chance_probability(per_deg2[others], self.listed.cell.radius_arcsec),
                    }
                )
        return pd.DataFrame(rows)

    def of_lost_sources(self) -> float:
        """Chance of a lost source to be claimed by a detection that no source has; NaN without any."""
        n_claimed, n_sources = (sum(numbers[i] for numbers in self.numbers[UNMATCHED]) for i in (2, 3))
        return n_claimed / n_sources if n_sources else float("nan")


def _rate(n_found: NDArray[np.int64], n_tried: NDArray[np.int64], weights: FloatArray) -> dict[str, float]:
    """Sums and their quotient with both kinds of interval."""
    rate = rate_of(n_found, n_tried, weights)
    return {
        "n_found": rate.n_found,
        "n_tried": rate.n_tried,
        "chance": rate.value,
        "chance_lower": rate.lower,
        "chance_upper": rate.upper,
        "chance_lower_fields": rate.lower_fields,
        "chance_upper_fields": rate.upper_fields,
        "chance_design_effect": rate.design_effect,
    }
