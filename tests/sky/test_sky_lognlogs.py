"""Random skies: exact Poisson process, common random numbers, helpful refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from sky_contexts import HARD, context

from survey_mc.errors import BadInput
from survey_mc.rng import stream
from survey_mc.sky import RELATIONS, draw_sky
from survey_mc.sky.lognlogs import LogNLogSParams, poisson_fluxes
from survey_mc.sky.relations import number_counts

Z_1E4 = 3.89  # two-sided 1e-4 false alarm of a normal variate
AREA_DEG2 = (2 * (1024.0 + 60.0) / 3600.0) ** 2


def test_a_lower_flux_limit_only_adds_fainter_sources() -> None:
    shallow = draw_sky(LogNLogSParams(flux_min_cgs=1e-15), context()).sources
    deep = draw_sky(LogNLogSParams(flux_min_cgs=2e-17), context()).sources
    assert len(deep) > 10 * len(shallow)
    assert deep.head(len(shallow)).equals(shallow)
    assert deep["flux_cgs"].iloc[len(shallow)] < 1e-15


def test_bands_share_positions_and_rank() -> None:
    soft = draw_sky(LogNLogSParams(), context()).sources
    hard = draw_sky(LogNLogSParams(), context(band=HARD)).sources
    n = min(len(soft), len(hard))
    assert np.array_equal(soft["x_arcsec"][:n], hard["x_arcsec"][:n])
    assert np.array_equal(soft["y_arcsec"][:n], hard["y_arcsec"][:n])
    assert soft["flux_cgs"].is_monotonic_decreasing
    assert hard["flux_cgs"].is_monotonic_decreasing


@pytest.mark.parametrize("name", RELATIONS.names)
def test_number_of_sources_is_poisson_with_the_mean_of_the_relation(name: str) -> None:
    counts = number_counts(name, "soft")
    n = [
        len(poisson_fluxes(counts, 0.01, 1e-16, 1e-12, stream(f"{name}{i}", "levels")))
        for i in range(400)
    ]  # fmt: skip
    mean = 0.01 * float(-np.diff(counts.number_above(np.array([1e-16, 1e-12])))[0])
    assert abs(np.mean(n) - mean) < Z_1E4 * np.sqrt(mean / 400)
    # the variance of 400 Poisson numbers scatters by sqrt(2/400) of itself
    assert abs(np.var(n) / mean - 1.0) < Z_1E4 * np.sqrt(2 / 400 + 1 / (400 * mean))


def test_sky_has_the_density_of_the_relation_over_the_image_and_its_margin() -> None:
    params, n_skies = LogNLogSParams(), 20
    n = sum(len(draw_sky(params, context(f"density{i}")).sources) for i in range(n_skies))
    counts = number_counts("hasinger1998", "soft").number_above(np.array([params.flux_min_cgs, params.flux_max_cgs]))
    mean = n_skies * AREA_DEG2 * float(counts[0] - counts[1])
    assert abs(n - mean) < Z_1E4 * np.sqrt(mean)  # 1.5 %


def test_fluxes_follow_the_relation() -> None:
    counts = number_counts("moretti2003", "soft")
    flux_cgs = poisson_fluxes(counts, 20.0, 1e-16, 1e-12, stream("fluxes", "levels"))
    edges_cgs = np.geomspace(1e-16, 1e-12, 25)
    expected = -20.0 * np.diff(counts.number_above(edges_cgs))
    found, _ = np.histogram(flux_cgs, edges_cgs)
    merged = expected > 5
    chi2 = float(((found - expected)[merged] ** 2 / expected[merged]).sum())
    # odds 1e-4 each side for a χ² of this many degrees of freedom (normal approximation)
    assert abs(chi2 - merged.sum()) < Z_1E4 * np.sqrt(2 * merged.sum()) + 3


def test_no_source_is_outside_the_limits() -> None:
    flux_cgs = draw_sky(LogNLogSParams(flux_min_cgs=3e-16, flux_max_cgs=1e-15), context()).sources["flux_cgs"]
    assert flux_cgs.between(3e-16, 1e-15).all()
    mean = AREA_DEG2 * float(-np.diff(number_counts("hasinger1998", "soft").number_above(np.array([3e-16, 1e-15])))[0])
    assert abs(len(flux_cgs) - mean) < Z_1E4 * np.sqrt(mean)


def test_positions_are_uniform_in_the_field_and_its_margin() -> None:
    sources = draw_sky(LogNLogSParams(flux_min_cgs=1e-17, margin_arcmin=2.0), context()).sources
    half_arcsec = 1024.0 + 120.0
    for axis in ("x_arcsec", "y_arcsec"):
        found, _ = np.histogram(sources[axis], 20, (-half_arcsec, half_arcsec))
        chi2 = ((found - found.mean()) ** 2 / found.mean()).sum()
        assert found.sum() == len(sources)
        assert abs(chi2 - 19) < Z_1E4 * np.sqrt(2 * 19) + 3


@settings(max_examples=25, deadline=None)
@given(first=st.floats(0.0, 50.0), length=st.floats(0.0, 3000.0), longer=st.floats(1.0, 5.0))
def test_arrivals_do_not_depend_on_how_far_they_are_drawn(first: float, length: float, longer: float) -> None:
    from survey_mc.sky.lognlogs import _arrivals_between

    short = _arrivals_between(first, first + length, stream("p", "levels"))
    far = _arrivals_between(first, first + longer * length, stream("p", "levels"))
    assert np.array_equal(far[: len(short)], short)
    assert np.all(far[len(short) :] >= first + length)


def test_normalisation_scales_the_number_of_sources() -> None:
    once = len(draw_sky(LogNLogSParams(), context()).sources)
    twice = len(draw_sky(LogNLogSParams(normalisation=2.0), context()).sources)
    assert abs(twice - 2 * once) < Z_1E4 * np.sqrt(twice + 4 * once)


def test_rates_are_fluxes_by_the_bands_factor() -> None:
    sources = draw_sky(LogNLogSParams(), context()).sources
    assert np.allclose(sources["rate_cps"] * 6.70e-13, sources["flux_cgs"], rtol=1e-14)


def test_one_name_stands_for_every_band_it_is_known_in() -> None:
    assert LogNLogSParams(model="moretti2003").model.hard == "moretti2003"
    only_soft = LogNLogSParams(model="hasinger1998")
    assert only_soft.model.hard is None
    with pytest.raises(BadInput, match="no relation is given for the hard band; known for hard: giacconi2001"):
        draw_sky(only_soft, context(band=HARD))


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"model": {"hard": "hasinger1998"}}, "'hasinger1998' is no relation of the hard band; known: giacconi2001"),
        ({"model": "hasinger"}, "unknown relation 'hasinger'; known: hasinger1998"),
        ({"flux_min_cgs": 1e-12, "flux_max_cgs": 1e-13}, "must be below flux_max_cgs"),
        ({"margin_arcmin": 0.5}, "greater than or equal to 1"),
        ({"fluxmin": 1.0}, "Extra inputs are not permitted"),
    ],
)
def test_wrong_parameters_are_refused_with_a_sentence(values: dict[str, object], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        LogNLogSParams(**values)
