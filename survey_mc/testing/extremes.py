"""Claims about fields at the end of what can happen: nothing, one photon, too many, at the border, unusable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from survey_mc.testing import fields
from survey_mc.testing.case import Case, nearest
from survey_mc.testing.claim import Violation, claims_of, expect
from survey_mc.types import FloatArray

VERY_BRIGHT_COUNTS = 3e5
EDGE_COUNTS = 1000.0
CROWD = 500


def empty_image_gives_no_rows(case: Case) -> None:
    """An image without a photon gives zero rows."""
    rows = case.find(fields.empty())
    expect(len(rows) == 0, "no rows for an empty image", len(rows))


def one_photon_is_survived(case: Case) -> None:
    """An image with one photon gives no rows to speak of, and no error."""
    exposure = np.full(fields.SHAPE, fields.EXPOSURE_S)
    rows = case.find(fields.observe(np.array([[100.2, 57.9]]), exposure, np.full(fields.SHAPE, 1e-5)))
    allowed = case.tolerances.single_photon_rows
    expect(len(rows) <= allowed, f"at most {allowed} rows for one photon", len(rows))


def unobserved_image_gives_no_rows(case: Case) -> None:
    """An image without exposure gives zero rows, whatever its pixels hold."""
    rows = case.find(replace(case.plain.observation, exposure_s=np.zeros(fields.SHAPE)))
    expect(len(rows) == 0, "no rows where nothing was observed", len(rows))


def unusable_exposure_is_refused(case: Case) -> None:
    """An exposure that is NaN, infinite or negative in a pixel is refused with a ValueError that names exposure_s."""
    for value in (np.nan, np.inf, -1.0):
        exposure = np.full(fields.SHAPE, fields.EXPOSURE_S)
        exposure[3, 4] = value
        expected = f"a ValueError that names exposure_s for an exposure of {value}"
        try:
            rows = case.find(replace(case.plain.observation, exposure_s=exposure))
        except ValueError as refusal:
            expect("exposure_s" in str(refusal), expected, f"ValueError: {refusal}")
        else:
            raise Violation(expected, f"{len(rows)} rows")


def very_bright_source_is_survived(case: Case) -> None:
    """A source of 300 000 photons is found at its place with about its counts."""
    place = np.array([[150.3, 110.6]])
    rows = case.find(case.draw("very bright", place, VERY_BRIGHT_COUNTS).observation)
    expect(len(rows) > 0, "a detection of the bright source", "none")
    found, distance = nearest(rows, place)
    expect(
        bool(distance[0] <= case.tolerances.position_pix),
        f"a detection within {case.tolerances.position_pix:g} pixels",
        f"{distance[0]:.2f} pixels",
    )
    low, high = case.tolerances.counts_ratio
    ratio = found["counts"].iloc[0] / VERY_BRIGHT_COUNTS
    expect(low <= ratio <= high, f"{low:g} to {high:g} of its counts", f"{ratio:.2f}")


def sources_at_the_border_are_found(case: Case) -> None:
    """Sources on the edges and in the corners of the image, cut in half or to a quarter, are found."""
    places = _border_places()
    rows = case.find(case.draw("border", places, EDGE_COUNTS).observation)
    expect(len(rows) > 0, "detections of sources at the border", "none")
    _, distance = nearest(rows, places)
    worst = int(distance.argmax())
    expect(
        bool(distance.max() <= case.tolerances.edge_pix),
        f"a detection within {case.tolerances.edge_pix:g} pixels of each source at the border",
        f"{distance[worst]:.1f} pixels from (x, y) = {places[worst].tolist()}",
    )


def _border_places() -> FloatArray:
    height, width = fields.SHAPE
    x, y = (0.0, (width - 1) / 2.0, width - 1.0), (0.0, (height - 1) / 2.0, height - 1.0)
    return np.array([(a, b) for a in x for b in y if not (a == x[1] and b == y[1])])


def crowded_field_is_survived(case: Case) -> None:
    """A field full of overlapping sources gives valid rows."""
    rng = case.rng("crowd positions")
    places = rng.uniform(0.0, np.array(fields.SHAPE[::-1]) - 1.0, (CROWD, 2))
    rows = case.find(case.draw("crowd", places, rng.uniform(20.0, 2000.0, CROWD)).observation)
    expect(len(rows) > 0, f"detections in a field of {CROWD} sources", "none")
    raised = np.bitwise_or.reduce(rows["flags"].to_numpy(), initial=0)
    known = sum(case.detector.flag_bits)
    expect(not raised & ~known, f"only documented bits of flags ({known:b})", f"{raised:b}")


EXTREME_CLAIMS = claims_of(
    empty_image_gives_no_rows,
    one_photon_is_survived,
    unobserved_image_gives_no_rows,
    unusable_exposure_is_refused,
    very_bright_source_is_survived,
    sources_at_the_border_are_found,
    crowded_field_is_survived,
)
