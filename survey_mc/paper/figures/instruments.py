"""Fig. 1 of the paper: the same sources seen by ROSAT HRI, XMM-Newton EPIC and Chandra.

Idea     point sources on a line, folded with each on-axis PSF and efficiency; what is plotted is the expected profile
         along a strip as wide as the half-energy width. A source is seen alone if it has more counts than the limit
         and its profile a maximum of its own; seen only together with a neighbour; or below the limit.
Source   paper Sect. 1, Fig. 1; all numbers of the telescopes are those of the instrument records.
Limits   expectations without noise, on axis. The sky is made up: fluxes are the quantiles of a power law, pairs are set
         at chosen separations, only their order is random. The limit knows nothing of neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import gammainc

from survey_mc.paper.figures.paper_figure import PaperFigure
from survey_mc.report.figures.style import BLUE, INPUT_COLOUR, ORANGE, SETTINGS
from survey_mc.report.numbers import power
from survey_mc.rng import stream
from survey_mc.telescope import INSTRUMENTS
from survey_mc.telescope.psf import KingPsf
from survey_mc.types import BoolArray, FloatArray
from survey_mc.units import SECONDS_PER_KS, flux_from_rate, rate_from_flux

if TYPE_CHECKING:
    from survey_mc.telescope.instruments import Instrument

SHOWN = ("rosat_hri", "xmm_epic", "chandra_acis")  # the order of the paper's figure, top to bottom
BAND = "soft"
EXPOSURE_KS = 50.0
CHANCE_OF_4_SIGMA = 3.17e-5  # one-sided

PAIR_SEPARATIONS_ARCSEC = (5.0, 8.0, 12.0, 20.0)
N_SINGLE = 4
SLOT_ARCSEC = 30.0  # room for one pair or one single source
FLUX_MIN_CGS = 3e-16
COUNTS_SLOPE = 0.7  # of N(>S) above it: between Moretti et al. 2003 (0.60) and Hasinger et al. 1998 (0.94)
SKY_SEED = "instruments 3"  # chosen so that bright sources stand in both halves of the line

STEP_ARCSEC = 0.05  # a tenth of the sharpest PSF
_NODES_ACROSS = 48
_MARKER_HEIGHT, _SEPARATION_HEIGHT = 0.86, 0.93  # fractions of a panel
_STATES = (  # label, marker, colour, filled
    ("seen alone", "o", BLUE, True),
    ("merged with a neighbour", "^", ORANGE, True),
    ("below the limit", "o", "#777777", False),
)


@dataclass(frozen=True, slots=True)
class LineOfSources:
    """Point sources on a line: position (arcsec) and flux (erg/cm²/s), from left to right.

    slots: middle and separation (arcsec; 0 for a single source) of each pair or single source.
    """

    x_arcsec: FloatArray
    flux_cgs: FloatArray
    slots: tuple[tuple[float, float], ...]

    @property
    def length_arcsec(self) -> float:
        return len(self.slots) * SLOT_ARCSEC


@dataclass(frozen=True, slots=True)
class Profile:
    """What one instrument makes of the line.

    counts_per_arcsec: expected along the strip at x_arcsec, background included. limit_counts: total counts of a source
    at the limit; limit_level: counts per arcsec at its peak. state: for each source 0 seen alone, 1 merged, 2 below.
    """

    instrument: Instrument
    x_arcsec: FloatArray
    counts_per_arcsec: FloatArray
    background_in_hew: float
    limit_counts: float
    limit_flux_cgs: float
    limit_level: float
    state: tuple[int, ...]


def line_of_sources() -> LineOfSources:
    """The made-up sky: pairs and single sources in equal slots, in random order, with random fluxes of the list."""
    rng = stream(SKY_SEED, "line")
    separations = np.array([*PAIR_SEPARATIONS_ARCSEC, *([0.0] * N_SINGLE)])
    slots = tuple(
        ((place + 0.5) * SLOT_ARCSEC, float(separation))
        for place, separation in enumerate(rng.permutation(separations))
    )
    x_arcsec = [middle + side for middle, gap in slots for side in ((-gap / 2.0, gap / 2.0) if gap else (0.0,))]
    n_sources = len(x_arcsec)
    rank = np.arange(n_sources) + 0.5
    flux_cgs = FLUX_MIN_CGS * (n_sources / rank) ** (1.0 / COUNTS_SLOPE)
    return LineOfSources(np.array(x_arcsec), rng.permutation(flux_cgs), slots)


def limit_counts(background_in_hew: float) -> float:
    """Total counts of a source whose half-energy circle just holds what the background does once in 4σ.

    The smallest n with P(≥ n) ≤ 3.17e-5 is taken as background plus half of the source's counts; four standard
    deviations of a Gaussian would be less than one photon for Chandra.
    """
    n = 1
    while gammainc(n, background_in_hew) > CHANCE_OF_4_SIGMA:
        n += 1
    return 2.0 * (n - background_in_hew)


def fold(sky: LineOfSources, instrument: Instrument) -> Profile:
    """The line of sources as an instrument sees it on axis in the soft band."""
    band = next(band for band in instrument.bands if band.name == BAND)
    exposure_s = EXPOSURE_KS * SECONDS_PER_KS
    psf = KingPsf.from_fwhm_hew(instrument.psf_fwhm_arcsec, instrument.psf_hew_arcsec)
    background_per_arcsec2 = band.background_cps_per_pix * exposure_s / instrument.scale_arcsec**2
    background_in_hew = background_per_arcsec2 * np.pi * psf.hew_arcsec**2 / 4.0
    floor = background_per_arcsec2 * psf.hew_arcsec

    x_arcsec = np.arange(0.0, sky.length_arcsec + STEP_ARCSEC / 2.0, STEP_ARCSEC)
    counts = np.asarray(rate_from_flux(sky.flux_cgs, band.flux_per_rate_cgs)) * exposure_s
    profile = np.full(x_arcsec.size, floor)
    for x_source, n in zip(sky.x_arcsec, counts, strict=True):
        profile += n * line_spread(psf, x_arcsec - x_source)

    limit = limit_counts(background_in_hew)
    alone = has_own_maximum(profile, sky.x_arcsec, psf.fwhm_arcsec / 2.0)
    state = np.where(counts < limit, 2, np.where(alone, 0, 1))
    return Profile(
        instrument,
        x_arcsec,
        profile,
        background_in_hew,
        limit,
        float(flux_from_rate(limit / exposure_s, band.flux_per_rate_cgs)),
        floor + limit * float(line_spread(psf, np.zeros(1))[0]),
        tuple(int(s) for s in state),
    )


def line_spread(psf: KingPsf, x_arcsec: FloatArray) -> FloatArray:
    """Fraction of a source's photons per arcsec along a strip as wide as the half-energy width."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES_ACROSS)
    y_arcsec = nodes * psf.hew_arcsec / 2.0
    density = psf.surface_brightness(np.hypot(x_arcsec[:, None], y_arcsec[None, :]))
    return np.asarray(density @ weights * psf.hew_arcsec / 2.0)


def has_own_maximum(profile: FloatArray, x_source_arcsec: FloatArray, reach_arcsec: float) -> BoolArray:
    """Which sources are the nearest one to some maximum of the profile and within reach of it."""
    inner = profile[1:-1]
    maxima_arcsec = STEP_ARCSEC * (1 + np.flatnonzero((inner > profile[:-2]) & (inner >= profile[2:])))
    alone = np.zeros(x_source_arcsec.size, dtype=np.bool_)
    for maximum_arcsec in maxima_arcsec:
        distance = np.abs(x_source_arcsec - maximum_arcsec)
        alone[distance.argmin()] |= distance.min() <= reach_arcsec
    return alone


def instruments_figure() -> PaperFigure:
    """The paper's Fig. 1."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    sky = line_of_sources()
    profiles = [fold(sky, INSTRUMENTS[name]) for name in SHOWN]
    with mpl.rc_context({**SETTINGS, "axes.grid": False}):
        figure = Figure(figsize=(6.8, 6.6), layout="constrained")
        axes = figure.subplots(len(profiles), 1, sharex=True, sharey=True)
        for axis, profile in zip(axes, profiles, strict=True):
            _draw(axis, sky, profile)
        _name_pairs(axes[0], sky)
        axes[0].set(yscale="log", ylim=(0.006, 8000.0), xlim=(0.0, sky.length_arcsec))
        axes[-1].set_xlabel("position along the strip (arcsec)")
        figure.supylabel(f"expected counts per arcsec in {EXPOSURE_KS:g} ks", fontsize=9.0)
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(handles), fontsize=8.0)
    return PaperFigure("instruments", "The same sources, three telescopes", _caption(sky, profiles), figure)


def _draw(axis: Any, sky: LineOfSources, profile: Profile) -> None:
    axis.plot(profile.x_arcsec, profile.counts_per_arcsec, color=INPUT_COLOUR, linewidth=1.0)
    axis.axhline(profile.limit_level, color=INPUT_COLOUR, linestyle=":", linewidth=1.2, label="detection limit")
    state = np.array(profile.state)
    for number, (label, marker, colour, filled) in enumerate(_STATES):
        x_arcsec = sky.x_arcsec[state == number]
        axis.plot(
            x_arcsec,
            np.full(x_arcsec.size, _MARKER_HEIGHT),
            marker,
            transform=axis.get_xaxis_transform(),
            color=colour,
            markerfacecolor=colour if filled else "none",
            markersize=4.5,
            label=label,
        )
    instrument = profile.instrument
    axis.set_title(f"{instrument.label}, FWHM {instrument.psf_fwhm_arcsec:.2g}″", loc="left")
    alone, merged = profile.state.count(0), profile.state.count(1)
    axis.set_title(
        f"{alone} alone, {merged} merged; limit {power(profile.limit_flux_cgs)[0]} erg/cm²/s",
        loc="right",
        fontsize=8.5,
        fontweight="normal",
    )


def _name_pairs(axis: Any, sky: LineOfSources) -> None:
    """The separation of each pair, above its markers."""
    for middle_arcsec, separation_arcsec in sky.slots:
        if separation_arcsec > 0.0:
            axis.text(
                middle_arcsec,
                _SEPARATION_HEIGHT,
                f"{separation_arcsec:g}″",
                transform=axis.get_xaxis_transform(),
                ha="center",
                fontsize=7.5,
            )


def _caption(sky: LineOfSources, profiles: list[Profile]) -> str:
    each = "; ".join(
        f"{p.instrument.label}: FWHM {p.instrument.psf_fwhm_arcsec:.2g}″, half-energy width "
        f"{p.instrument.psf_hew_arcsec:.2g}″, {p.background_in_hew:.2g} background counts in it, limit "
        f"{p.limit_counts:.2g} counts or {power(p.limit_flux_cgs)[0]} erg/cm²/s, {p.state.count(0)} of "
        f"{len(p.state)} sources seen alone, {p.state.count(1)} merged"
        for p in profiles
    )
    faintest, brightest = (power(float(flux_cgs))[0] for flux_cgs in (sky.flux_cgs.min(), sky.flux_cgs.max()))
    separations = ", ".join(f"{s:g}" for s in PAIR_SEPARATIONS_ARCSEC)
    return (
        f"The same {sky.x_arcsec.size} point sources on a line (pairs {separations}″ apart and {N_SINGLE} single "
        f"sources, {faintest} to {brightest} erg/cm²/s in 0.5-2 keV, their order random), "
        f"folded with the on-axis PSF and efficiency of each telescope: expected counts in {EXPOSURE_KS:g} ks, with "
        "background and without noise, along a strip as wide as the half-energy width. Dotted: peak of a lone source "
        "at the detection limit, whose half-energy circle holds as many counts as the background alone reaches with "
        f"the chance of 4σ ({power(CHANCE_OF_4_SIGMA)[0]}). Circles and triangles stand at the true positions; open: "
        "below the limit by its own counts; merged: above it, but without a maximum of its own. "
        f"{each}."
    )
