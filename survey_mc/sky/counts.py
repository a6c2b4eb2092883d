"""The analytic forms of number counts and their inverses.

Idea     every form answers two questions: how many sources per deg² are brighter than S, and at which flux does a
         given number lie. Power laws invert in closed form; the others by interpolation of ln S against ln N.
Source   Hasinger et al. 1993 (broken power law); Moretti et al. 2003, ApJ 588, 696, eq. 2 (smooth one).
Limits   1e-18 to 1e-10 erg/cm²/s for the interpolated inverses, whose relative error is below 1e-6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from survey_mc.caches import bounded_cache
from survey_mc.types import FloatArray

FLUX_UNIT_CGS = 1e-14  # fluxes inside the differential forms are counted in this unit
PIVOT_CGS = 2e-15  # Giacconi et al. 2001 and Moretti et al. 2003 normalise here
FLUX_FAINTEST_CGS = 1e-18
FLUX_BRIGHTEST_CGS = 1e-10
_GRID_STEP = 1e-3  # of ln S: linear interpolation errs by at most step²/8 × curvature < 1e-6


class Counts(Protocol):
    """Number counts of one population in one band."""

    def number_above(self, flux_cgs: FloatArray) -> FloatArray:
        """N(>S): sources per deg² brighter than S; falls with S."""

    def flux_at(self, number_per_deg2: FloatArray) -> FloatArray:
        """S with N(>S) equal to the given number: the inverse of `number_above`."""


@dataclass(frozen=True, slots=True)
class PowerLaw:
    """N(>S) = number_at_2e15 (S / 2e-15)^−slope."""

    number_at_2e15: float
    slope: float

    @classmethod
    def differential(cls, norm: float, slope: float) -> PowerLaw:
        """From dN/dS = norm (S / 1e-14)^−slope, norm in deg⁻² per erg/cm²/s, slope > 1."""
        at_pivot = norm * FLUX_UNIT_CGS / (slope - 1) * (PIVOT_CGS / FLUX_UNIT_CGS) ** (1 - slope)
        return cls(at_pivot, slope - 1)

    def number_above(self, flux_cgs: FloatArray) -> FloatArray:
        return np.asarray(self.number_at_2e15 * (flux_cgs / PIVOT_CGS) ** -self.slope)

    def flux_at(self, number_per_deg2: FloatArray) -> FloatArray:
        return np.asarray(PIVOT_CGS * (number_per_deg2 / self.number_at_2e15) ** (-1 / self.slope))


@dataclass(frozen=True, slots=True)
class BrokenPowerLaw:
    """dN/dS = norm (S / 1e-14)^−slope with one pair (norm, slope) below the break and one above.

    norm: deg⁻² per erg/cm²/s; both slopes > 1. N(>S) is the integral, continuous by construction.
    """

    flux_break_cgs: float
    faint_norm: float
    faint_slope: float
    bright_norm: float
    bright_slope: float

    @classmethod
    def continuous(
        cls, flux_break_cgs: float, faint_norm: float, faint_slope: float, bright_slope: float
    ) -> BrokenPowerLaw:
        """The form whose dN/dS is continuous at the break."""
        bright_norm = faint_norm * (flux_break_cgs / FLUX_UNIT_CGS) ** (bright_slope - faint_slope)
        return cls(flux_break_cgs, faint_norm, faint_slope, bright_norm, bright_slope)

    def number_above(self, flux_cgs: FloatArray) -> FloatArray:
        flux = np.asarray(flux_cgs, dtype=np.float64)
        bright, faint, _, offset = _branches(self)
        return np.where(flux > self.flux_break_cgs, bright.number_above(flux), faint.number_above(flux) + offset)

    def flux_at(self, number_per_deg2: FloatArray) -> FloatArray:
        number = np.asarray(number_per_deg2, dtype=np.float64)
        bright, faint, at_break, offset = _branches(self)
        is_bright = number < at_break
        flux = np.empty_like(number)
        flux[is_bright] = bright.flux_at(number[is_bright])
        flux[~is_bright] = faint.flux_at(number[~is_bright] - offset)
        return flux


@bounded_cache(16)
def _branches(counts: BrokenPowerLaw) -> tuple[PowerLaw, PowerLaw, float, float]:
    """The bright and the faint power law, N(>break), and what the faint one needs to meet the bright one there."""
    bright = PowerLaw.differential(counts.bright_norm, counts.bright_slope)
    faint = PowerLaw.differential(counts.faint_norm, counts.faint_slope)
    flux_break = np.array([counts.flux_break_cgs])
    at_break = float(bright.number_above(flux_break)[0])
    return bright, faint, at_break, at_break - float(faint.number_above(flux_break)[0])


@dataclass(frozen=True, slots=True)
class MorettiCounts:
    """N(>S) = number (2e-15)^a / (S^a + S0^(a−b) S^b), a the bright and b the faint slope, S0 the break."""

    number: float
    bright_slope: float
    faint_slope: float
    flux_break_cgs: float

    def number_above(self, flux_cgs: FloatArray) -> FloatArray:
        flux = np.asarray(flux_cgs) / PIVOT_CGS
        break_term = (self.flux_break_cgs / PIVOT_CGS) ** (self.bright_slope - self.faint_slope)
        return np.asarray(self.number / (flux**self.bright_slope + break_term * flux**self.faint_slope))

    def flux_at(self, number_per_deg2: FloatArray) -> FloatArray:
        return _interpolated_flux(self, number_per_deg2)


@dataclass(frozen=True, slots=True)
class SumOfCounts:
    """Several populations together."""

    parts: tuple[PowerLaw | BrokenPowerLaw, ...]

    def number_above(self, flux_cgs: FloatArray) -> FloatArray:
        return np.asarray(sum(part.number_above(flux_cgs) for part in self.parts))

    def flux_at(self, number_per_deg2: FloatArray) -> FloatArray:
        return _interpolated_flux(self, number_per_deg2)


def _interpolated_flux(counts: MorettiCounts | SumOfCounts, number_per_deg2: FloatArray) -> FloatArray:
    ln_number, ln_flux = _inverse_grid(counts)
    return np.asarray(np.exp(np.interp(np.log(number_per_deg2), ln_number, ln_flux)))


@bounded_cache(16)
def _inverse_grid(counts: MorettiCounts | SumOfCounts) -> tuple[FloatArray, FloatArray]:
    """(ln N ascending, ln S) on a fine grid of ln S."""
    n_steps = int(np.log(FLUX_BRIGHTEST_CGS / FLUX_FAINTEST_CGS) / _GRID_STEP) + 1
    ln_flux = np.linspace(np.log(FLUX_BRIGHTEST_CGS), np.log(FLUX_FAINTEST_CGS), n_steps)
    return np.log(counts.number_above(np.exp(ln_flux))), ln_flux
