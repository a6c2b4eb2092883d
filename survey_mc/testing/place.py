"""Claims about positions: sources are found where they are, and move and turn with the sky."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from survey_mc.testing import fields
from survey_mc.testing.case import Case, nearest, positions_of
from survey_mc.testing.claim import Violation, claims_of, expect
from survey_mc.types import FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

BRIGHT_COUNTS = 2000.0
SHIFT_PIX = (32, -16)  # whole background meshes of the usual sizes: those are not what this is about


def bright_sources_are_found_in_place(case: Case) -> None:
    """Each isolated bright source has a detection of its own, at its place."""
    if len(case.plain_rows) == 0:
        raise Violation("detections of bright sources", "none")
    found, distance = nearest(case.plain_rows, case.plain.positions)
    worst = int(distance.argmax())
    expect(
        bool(distance.max() <= case.tolerances.position_pix),
        f"a detection within {case.tolerances.position_pix:g} pixels of each source",
        f"{distance[worst]:.2f} pixels from (x, y) = {np.round(case.plain.positions[worst], 1).tolist()}",
    )
    expect(found["det_id"].is_unique, "one detection for each source", "a detection that serves two")


def pixel_origin_is_the_first_centre(case: Case) -> None:
    """The mean offset of bright sources is zero along both axes: (0, 0) is the centre of the first pixel."""
    positions = fields.lattice(case.rng("origin positions"), 4, 4)
    drawn = case.draw("origin", positions, BRIGHT_COUNTS)
    rows = case.find(drawn.observation)
    expect(len(rows) > 0, "detections of bright sources", "none")
    found, distance = nearest(rows, positions)
    near = distance < 2.0 * case.tolerances.position_pix
    offset = (positions_of(found) - positions)[near]
    expect(bool(near.mean() > 0.8), "at least 80 % of the bright sources", f"{near.mean():.0%}")
    mean = offset.mean(axis=0)
    expect(
        bool(np.abs(mean).max() <= case.tolerances.bias_pix),
        f"a mean offset within ±{case.tolerances.bias_pix:g} pixels",
        f"x {mean[0]:+.2f}, y {mean[1]:+.2f}",
    )


def shifted_sky_gives_shifted_sources(case: Case) -> None:
    """A shift of the photons by whole pixels shifts the sources with them."""
    shifted = case.find(fields.moved(case.plain.observation, *SHIFT_PIX))
    margin_pix = 8.0
    inside = _inside(case.plain.positions + np.array(SHIFT_PIX), margin_pix)
    places = case.plain.positions[inside]
    moved_rows = shifted.assign(x_pix=shifted["x_pix"] - SHIFT_PIX[0], y_pix=shifted["y_pix"] - SHIFT_PIX[1])
    expect_same_sources(case, moved_rows, case.plain_rows, places, f"after a shift by {SHIFT_PIX}")


def _inside(positions: FloatArray, margin_pix: float) -> FloatArray:
    height, width = fields.SHAPE
    far = np.array([width, height]) - 1.0 - margin_pix
    return np.asarray(np.all((positions > margin_pix) & (positions < far), axis=1))


def turned_sky_gives_turned_sources(case: Case) -> None:
    """One, two and three quarter turns of the photons turn the sources with them."""
    for turns in (1, 2, 3):
        observation = fields.turned(case.plain.observation, turns)
        rows = case.find(observation)
        back = fields.turned_positions(positions_of(rows), 4 - turns, observation.counts.shape)
        errors = rows[["x_err_pix", "y_err_pix"]].to_numpy()[:, :: -1 if turns % 2 else 1]
        unturned = rows.assign(x_pix=back[:, 0], y_pix=back[:, 1], x_err_pix=errors[:, 0], y_err_pix=errors[:, 1])
        words = f"after {turns} quarter turn{'s' * (turns > 1)}"
        expect_same_sources(case, unturned, case.plain_rows, case.plain.positions, words)


def expect_same_sources(case: Case, rows: DataFrame, reference: DataFrame, places: FloatArray, words: str) -> None:
    """Raise `Violation` unless both have the same detections next to these places."""
    expect(len(rows) > 0 and len(reference) > 0, f"detections {words}", f"{len(reference)} before, {len(rows)} now")
    before, _ = nearest(reference, places)
    now, distance = nearest(rows, positions_of(before))
    stated = np.nan_to_num(np.hypot(before["x_err_pix"], before["y_err_pix"]).to_numpy())
    allowed = case.tolerances.same_pix + case.tolerances.same_errors * stated
    change = np.abs(now["counts"].to_numpy() / before["counts"].to_numpy() - 1.0)
    same = (distance <= allowed) & (change <= case.tolerances.same_counts)
    lost = distance > case.tolerances.position_pix
    worst = int((distance - allowed).argmax())
    expect(
        bool(same.mean() >= case.tolerances.same_share and not lost.any()),
        f"{case.tolerances.same_share:.0%} of the bright sources within about {np.median(allowed):.2f} pixels and "
        f"{case.tolerances.same_counts:.0%} of their counts, none lost, {words}",
        f"{same.mean():.0%}, up to {distance[worst]:.2f} pixels and {change.max():.0%} of the counts away",
    )


PLACE_CLAIMS = claims_of(
    bright_sources_are_found_in_place,
    pixel_origin_is_the_first_centre,
    shifted_sky_gives_shifted_sources,
    turned_sky_gives_turned_sources,
)
