"""Published number counts against a table of N(>S) worked out independently."""

from __future__ import annotations

import numpy as np
import pytest

from survey_mc.errors import BadInput
from survey_mc.registry import UnknownName
from survey_mc.sky import RELATIONS
from survey_mc.sky.relations import number_counts, relations_for

SOFT_FLUX_CGS = np.array([1e-16, 3e-16, 6e-16, 1e-15, 2e-15, 5e-15, 1e-14, 3e-14, 1e-13])
SOFT_PER_DEG2 = {
    "hasinger1998": [8936, 3168, 1641, 1007, 515, 205, 96.7, 20.9, 2.6],
    "giacconi2001": [4722, 1856, 1030, 667, 370, 170, 94, 37, 13],
    "moretti2003": [3222, 1656, 1080, 782, 492, 244, 126, 31.3, 4.5],
    "georgakakis2008": [3554, 1781, 1122, 781, 453, 180, 65.8, 12.7, 2.1],
    "lehmer2012_agn": [3007, 1632, 1076, 772, 464, 189, 69.1, 13.6, 2.3],
}
HARD_FLUX_CGS = np.array([1e-15, 3e-15, 1e-14, 3e-14, 1e-13])
HARD_PER_DEG2 = {
    "giacconi2001": [2400, 800, 240, 80, 24],
    "moretti2003": [2432, 1086, 301, 67.6, 11.1],
    "georgakakis2008": [2077, 948, 296, 57.3, 9.2],
}
ALL_COUNTS = [(relation.name, band) for relation in RELATIONS for band in relation.bands]


def assert_prints_as(values: np.ndarray, printed: list[float]) -> None:
    """Every value agrees with the printed one to a unit of its last digit: the table is partly rounded, partly cut."""
    for value, text in zip(values, map(str, printed), strict=True):
        unit = 10.0 ** -len(text.partition(".")[2])
        assert value == pytest.approx(float(text), abs=unit)


@pytest.mark.parametrize("name", SOFT_PER_DEG2)
def test_soft_counts_agree_with_the_table(name: str) -> None:
    assert_prints_as(number_counts(name, "soft").number_above(SOFT_FLUX_CGS), SOFT_PER_DEG2[name])


@pytest.mark.parametrize("name", HARD_PER_DEG2)
def test_hard_counts_agree_with_the_table(name: str) -> None:
    assert_prints_as(number_counts(name, "hard").number_above(HARD_FLUX_CGS), HARD_PER_DEG2[name])


@pytest.mark.parametrize(("name", "band"), ALL_COUNTS)
def test_flux_at_inverts_the_counts_to_1e_6(name: str, band: str) -> None:
    counts = number_counts(name, band)
    flux_cgs = np.geomspace(1.01e-18, 0.99e-10, 4001)
    assert np.allclose(counts.flux_at(counts.number_above(flux_cgs)), flux_cgs, rtol=1e-6, atol=0.0)


@pytest.mark.parametrize(("name", "band"), ALL_COUNTS)
def test_counts_fall_with_flux(name: str, band: str) -> None:
    assert np.all(np.diff(number_counts(name, band).number_above(np.geomspace(1e-18, 1e-10, 2000))) < 0.0)


def test_total_of_lehmer_is_above_its_active_nuclei() -> None:
    flux_cgs = np.geomspace(1e-17, 1e-13, 50)
    for band in ("soft", "hard"):
        total = number_counts("lehmer2012", band).number_above(flux_cgs)
        assert np.all(total > number_counts("lehmer2012_agn", band).number_above(flux_cgs))


def test_numbers_inside_10_arcmin_are_those_of_the_paper() -> None:
    area_deg2 = np.pi * (10.0 / 60.0) ** 2
    hasinger = number_counts("hasinger1998", "soft").number_above(np.array([6e-16, 6.7e-15]))
    assert hasinger * area_deg2 == pytest.approx([143.0, 13.2], rel=0.005)


def test_missing_band_names_the_relations_that_have_it() -> None:
    with pytest.raises(BadInput, match=r"hasinger1998.*no hard band; known for hard: giacconi2001, moretti2003"):
        number_counts("hasinger1998", "hard")


def test_unknown_relation_lists_the_known_ones() -> None:
    with pytest.raises(UnknownName, match="did you mean 'moretti2003'"):
        number_counts("moreti2003", "soft")


def test_every_relation_says_where_its_coefficients_come_from() -> None:
    for relation in RELATIONS:
        assert "read" in relation.about or "ecalled" in relation.about
        assert relation.source
    assert "hasinger1998" not in relations_for("hard")
