"""Published relations between the number of X-ray sources and their flux.

Idea     N(>S), sources per deg² brighter than S, and its inverse: all a Poisson sky of random fluxes needs.
Source   named in each relation, with the standing of its coefficients: "read" in a publication or in published code
         that carries them, or "recalled", i.e. known to agree with the published curve but not read there again.
Limits   1e-18 to 1e-10 erg/cm²/s; outside its survey's range a relation is an extrapolation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from survey_mc.errors import BadInput
from survey_mc.registry import Registry
from survey_mc.sky.counts import BrokenPowerLaw, Counts, MorettiCounts, PowerLaw, SumOfCounts


@dataclass(frozen=True, slots=True)
class Relation:
    """A published relation: its number counts by band name, where they come from and which energies they are for."""

    name: str
    about: str
    source: str
    counts: Mapping[str, Counts]

    @property
    def bands(self) -> tuple[str, ...]:
        return tuple(self.counts)


_HASINGER1998 = Relation(
    name="hasinger1998",
    about="ROSAT deep survey of the Lockman Hole, 0.5-2 keV: broken power law, break at 2.66e-14. Coefficients "
    "recalled; N(>1e-15) = 1007 against 970 ± 150 printed. Over-predicts Chandra counts below 3e-16 by a factor 2.",
    source="Hasinger et al. 1998, A&A 329, 482 (slopes of Hasinger et al. 1993)",
    counts={
        "soft": BrokenPowerLaw(
            flux_break_cgs=2.66e-14,
            faint_norm=111.0e14,
            faint_slope=1.94,
            bright_norm=238.1e14,
            bright_slope=2.72,
        )
    },
)

_GIACCONI2001 = Relation(
    name="giacconi2001",
    about="First 120 ks of the Chandra Deep Field South, 0.5-2 and 2-10 keV: single power laws, 370 and 1200 deg⁻² at "
    "2e-15 with slopes 0.85 and 1.0. Coefficients recalled. Over-predicts bright soft sources.",
    source="Giacconi et al. 2001, ApJ 551, 624",
    counts={
        "soft": PowerLaw(number_at_2e15=370.0, slope=0.85),
        "hard": PowerLaw(number_at_2e15=1200.0, slope=1.0),
    },
)

_MORETTI2003 = Relation(
    name="moretti2003",
    about="Six surveys from ROSAT to Chandra joined, 0.5-2 and 2-10 keV: smooth double power law of N(>S). "
    "Soft coefficients read in published code, hard ones recalled.",
    source="Moretti et al. 2003, ApJ 588, 696",
    counts={
        "soft": MorettiCounts(number=6150.0, bright_slope=1.82, faint_slope=0.60, flux_break_cgs=1.48e-14),
        "hard": MorettiCounts(number=5300.0, bright_slope=1.57, faint_slope=0.44, flux_break_cgs=4.5e-15),
    },
)

_GEORGAKAKIS2008 = Relation(
    name="georgakakis2008",
    about="Chandra surveys with a Bayesian treatment of incompleteness and Eddington bias, 0.5-2 and 2-10 keV: "
    "continuous broken power law. Breaks read in published code, slopes and normalisations recalled.",
    source="Georgakakis et al. 2008, MNRAS 388, 1205",
    counts={
        "soft": BrokenPowerLaw.continuous(0.63e-14, 1.51e16, 1.58, 2.50),
        "hard": BrokenPowerLaw.continuous(1.23e-14, 3.79e16, 1.56, 2.52),
    },
)

_LEHMER_AGN_SOFT = BrokenPowerLaw.continuous(6.0e-15, 169.56e14, 1.49, 2.48)
_LEHMER_AGN_HARD = BrokenPowerLaw.continuous(6.4e-15, 573.13e14, 1.32, 2.55)

_LEHMER2012_AGN = Relation(
    name="lehmer2012_agn",
    about="Active nuclei of the 4 Ms Chandra Deep Field South, 0.5-2 and 2-8 keV (its hard band ends at 8, not "
    "10 keV): continuous broken power law. Hard coefficients read in published code, soft ones recalled.",
    source="Lehmer et al. 2012, ApJ 752, 46, Table 1",
    counts={"soft": _LEHMER_AGN_SOFT, "hard": _LEHMER_AGN_HARD},
)

_LEHMER2012 = Relation(
    name="lehmer2012",
    about="Active nuclei, normal galaxies and Galactic stars of the 4 Ms Chandra Deep Field South together, 0.5-2 and "
    "2-8 keV (its hard band ends at 8, not 10 keV). Hard coefficients read in published code, soft ones recalled.",
    source="Lehmer et al. 2012, ApJ 752, 46, Table 1",
    counts={
        "soft": SumOfCounts(
            (
                _LEHMER_AGN_SOFT,
                PowerLaw.differential(1.51e14, 2.16),
                PowerLaw.differential(4.09e14, 1.55),
            )
        ),
        "hard": SumOfCounts(
            (
                _LEHMER_AGN_HARD,
                PowerLaw.differential(1.10e14, 2.29),
                PowerLaw.differential(0.64e14, 1.79),
            )
        ),
    },
)

RELATIONS: Registry[Relation] = Registry(
    "logN-logS relation",
    [_HASINGER1998, _GIACCONI2001, _MORETTI2003, _GEORGAKAKIS2008, _LEHMER2012, _LEHMER2012_AGN],
)


def relations_for(band: str) -> tuple[str, ...]:
    """Names of the relations known in a band."""
    return tuple(relation.name for relation in RELATIONS if band in relation.counts)


def number_counts(name: str, band: str) -> Counts:
    """The number counts of a relation in a band ("soft", "hard"); an error names the relations that have the band."""
    relation = RELATIONS[name]
    if band not in relation.counts:
        known = ", ".join(relations_for(band)) or "none"
        raise BadInput("sky.model", f"relation {name!r} has no {band} band; known for {band}: {known}")
    return relation.counts[band]
