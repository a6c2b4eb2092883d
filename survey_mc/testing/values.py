"""Claims about measured values: counts, errors, exposure, rates and fluxes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from survey_mc.testing import fields
from survey_mc.testing.case import Case, nearest, pixels_of, positions_of
from survey_mc.testing.claim import NotApplicable, claims_of, expect
from survey_mc.types import FloatArray, FloatImage
from survey_mc.units import flux_from_rate

if TYPE_CHECKING:
    from pandas import DataFrame

RELATIVE = 1e-6  # of numbers that follow from each other
VIGNETTED_COUNTS = 1500.0
NEIGHBOURHOOD_PIX = 7  # the exposure "at the position" may be taken anywhere in this box
LEAST_SHARE = 0.4  # of the exposure, for a source that must be found


def counts_are_those_of_the_source(case: Case) -> None:
    """Bright sources have about their counts, with an error of about their square root."""
    found, _ = nearest(case.plain_rows, case.plain.positions)
    low, high = case.tolerances.counts_ratio
    ratio = float(np.median(found["counts"] / case.plain.counts))
    expect(low <= ratio <= high, f"a median of measured / true counts of {low:g} to {high:g}", f"{ratio:.2f}")
    low, high = case.tolerances.counts_noise
    noise = float(np.median(found["counts_err"] / np.sqrt(np.maximum(found["counts"], 1.0))))
    expect(low <= noise <= high, f"counts_err of {low:g} to {high:g} √counts", f"{noise:.2f}")


def errors_are_numbers(case: Case) -> None:
    """Errors are ≥ 0; those of counts are finite, those of positions are known for both axes or for none."""
    rows = case.plain_rows
    expect(bool(np.all(np.isfinite(rows["counts_err"]))), "a finite counts_err in every row", "NaN or infinite")
    one_sided = np.isnan(rows["x_err_pix"]) != np.isnan(rows["y_err_pix"])
    expect(not one_sided.any(), "errors of both axes or of none", f"{int(one_sided.sum())} rows with one")


def position_errors_are_the_scatter(case: Case) -> None:
    """The offsets of bright sources are what the position errors say."""
    found, distance = nearest(case.plain_rows, case.plain.positions)
    errors = found[["x_err_pix", "y_err_pix"]].to_numpy()
    if np.isnan(errors).all():
        raise NotApplicable("the procedure gives no position errors")
    expect(bool(np.all(errors > 0.0)), "position errors > 0 of bright sources", "0 or NaN")
    near = distance <= 3.0 * case.tolerances.position_pix
    pulls = ((positions_of(found) - case.plain.positions) / errors)[near]
    low, high = case.tolerances.pull_rms
    rms = float(np.sqrt(np.square(pulls).mean())) if len(pulls) else np.inf
    expect(low <= rms <= high, f"an rms of offset / error of {low:g} to {high:g}", f"{rms:.2f}")


def rates_follow_from_counts(case: Case) -> None:
    """rate_cps is counts / exposure_s, flux_cgs its multiple or NaN, offaxis_arcmin that of the grid."""
    rows, plain = case.plain_rows, case.plain.observation
    _expect_close(rows["rate_cps"], rows["counts"] / rows["exposure_s"], "rate_cps = counts / exposure_s")
    factor = plain.band.flux_per_rate_cgs
    if factor is not None:
        flux = np.asarray(flux_from_rate(rows["rate_cps"].to_numpy(), factor))
        _expect_close(rows["flux_cgs"], flux, "flux_cgs = rate_cps × flux_per_rate_cgs")
    offaxis = plain.grid.offaxis_arcmin(rows["x_pix"].to_numpy(), rows["y_pix"].to_numpy())
    _expect_close(rows["offaxis_arcmin"], offaxis, "offaxis_arcmin as the grid gives it")
    unknown = case.find(replace(plain, band=replace(plain.band, flux_per_rate_cgs=None)))
    known = unknown[["flux_cgs", "flux_err_cgs"]].notna().to_numpy().any()
    expect(not known, "fluxes of NaN where the band has no conversion factor", "numbers")


def _expect_close(found: object, expected: object, words: str) -> None:
    values, wanted = np.asarray(found, dtype=np.float64), np.asarray(expected, dtype=np.float64)
    close = np.isclose(values, wanted, rtol=RELATIVE, atol=0.0, equal_nan=True)
    worst = int(np.argmin(close)) if len(close) else 0
    expect(bool(close.all()), words, f"row {worst}: {values[worst : worst + 1]}, not {wanted[worst : worst + 1]}")


def vignetting_is_corrected(case: Case) -> None:
    """Under a vignetted exposure map counts are as they fell, exposure_s is the map's, and rates are those on axis."""
    share = vignetted_share()
    positions = fields.lattice(case.rng("vignetted positions"), 4, 4)
    drawn = case.draw("vignetted", positions, VIGNETTED_COUNTS, share=share)
    rows = case.find(drawn.observation)
    expect(len(rows) > 0, "detections of bright sources", "none")
    _expect_exposure(case, rows, drawn.observation.exposure_s)
    _expect_close(rows["rate_cps"], rows["counts"] / rows["exposure_s"], "rate_cps = counts / exposure_s")
    found, distance = nearest(rows, positions)
    there = share[tuple(np.rint(positions[:, ::-1]).astype(np.int64).T)]
    deep = there >= LEAST_SHARE
    expect(
        bool(distance[deep].max() <= case.tolerances.position_pix),
        f"a detection within {case.tolerances.position_pix:g} pixels of each source",
        f"{distance[deep].max():.2f} pixels",
    )
    rate = found["rate_cps"].to_numpy()
    inner, outer = np.median(rate[there > 0.75]), np.median(rate[deep & (there < 0.65)])
    expect(
        bool(abs(outer / inner - 1.0) <= case.tolerances.rate),
        f"equal rates at full and reduced exposure within {case.tolerances.rate:.0%}",
        f"a ratio of {outer / inner:.2f}",
    )


def vignetted_share() -> FloatImage:
    """Relative exposure that falls to 0.3 at the rim of a round field of view, and is 0 beyond."""
    height, width = fields.SHAPE
    y, x = np.mgrid[:height, :width]
    radius: FloatArray = np.hypot(x - (width - 1) / 2.0, y - (height - 1) / 2.0) / (width / 2.0 + 8.0)
    return np.where(radius < 1.0, 1.0 - 0.7 * radius**2, 0.0)


def _expect_exposure(case: Case, rows: DataFrame, exposure_s: FloatImage) -> None:
    y, x = pixels_of(rows, exposure_s.shape)
    low = ndimage.minimum_filter(exposure_s, NEIGHBOURHOOD_PIX)[y, x] * (1.0 - case.tolerances.exposure)
    high = ndimage.maximum_filter(exposure_s, NEIGHBOURHOOD_PIX)[y, x] * (1.0 + case.tolerances.exposure)
    given = rows["exposure_s"].to_numpy()
    wrong = np.flatnonzero((given < low) | (given > high))
    if len(wrong):
        first = wrong[0]
        found = f"{given[first]:g} s where the map has {exposure_s[y[first], x[first]]:g} s"
        expect(False, "exposure_s of the map at the position", found)


VALUE_CLAIMS = claims_of(
    counts_are_those_of_the_source,
    errors_are_numbers,
    position_errors_are_the_scatter,
    rates_follow_from_counts,
    vignetting_is_corrected,
)
