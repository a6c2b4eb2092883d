"""Designed skies: pairs, flux grids, clusters, images, combinations."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError
from sky_contexts import HALF_WIDTH_ARCSEC, HARD, SOFT, context

from survey_mc.errors import BadInput
from survey_mc.sky import SKIES, AnySkyParams, draw_sky
from survey_mc.sky.clusters import TABLE_2, ClustersParams, core_radii_arcsec, count_rates
from survey_mc.sky.combined import CombinedParams
from survey_mc.sky.cosmology import angle_arcsec
from survey_mc.sky.empty import EmptyParams
from survey_mc.sky.flux_grid import FluxGridParams
from survey_mc.sky.image import ImageParams
from survey_mc.sky.lognlogs import LogNLogSParams
from survey_mc.sky.pair_rows import PairRowsParams
from survey_mc.types import SKY_COLUMNS, Band


@pytest.mark.parametrize("name", SKIES.names)
def test_every_kind_draws_its_tiny_sky_with_the_declared_columns(name: str) -> None:
    sources = draw_sky(SKIES[name].tiny, context()).sources
    assert tuple(sources.columns) == SKY_COLUMNS
    assert sources["group_id"].dtype == np.int32
    assert set(sources["kind"]) <= {"point", "extended"}
    assert (sources["rate_cps"] > 0).all()
    assert sources.equals(draw_sky(SKIES[name].tiny, context()).sources)


def test_test_1_has_36_sources_in_pairs_at_the_papers_separations() -> None:
    sources = draw_sky(PairRowsParams(), context()).sources
    first, second = sources.iloc[::2].reset_index(), sources.iloc[1::2].reset_index()
    separation = np.hypot(second["x_arcsec"] - first["x_arcsec"], second["y_arcsec"] - first["y_arcsec"])
    assert len(sources) == 36
    assert np.allclose(separation, first["group_sep_arcsec"], atol=1e-9)
    assert sorted(set(first["group_sep_arcsec"])) == [15.0, 30.0, 60.0]
    assert np.allclose(first["rate_cps"] * 1e4, 100.0)
    assert sorted(set((second["rate_cps"] * 1e4).round(6))) == [20.0, 30.0, 50.0, 100.0, 200.0, 500.0]


def test_pairs_keep_their_distance_and_lie_within_10_arcmin() -> None:
    sources = draw_sky(PairRowsParams(), context()).sources
    xy_arcsec = sources[["x_arcsec", "y_arcsec"]].to_numpy()
    distance = np.hypot(*(xy_arcsec[:, None] - xy_arcsec[None]).T)
    other = sources["group_id"].to_numpy()[:, None] != sources["group_id"].to_numpy()[None]
    assert distance[other].min() > 120.0
    assert np.hypot(*xy_arcsec.T).max() < 603.0


def test_test_2_puts_points_left_and_clusters_right() -> None:
    params = PairRowsParams(second="extended", counts=(100.0, 200.0, 500.0, 1000.0))
    sources = draw_sky(params, context()).sources
    assert (sources["kind"].iloc[::2] == "point").all()
    assert (sources["kind"].iloc[1::2] == "extended").all()
    assert np.allclose(sources["core_radius_arcsec"].iloc[1::2], 30.0)
    assert sources["core_radius_arcsec"].iloc[::2].isna().all()


def test_jitter_moves_pairs_as_a_whole_by_less_than_half_a_pixel() -> None:
    still = draw_sky(PairRowsParams(jitter_arcsec=0.0), context()).sources
    moved = draw_sky(PairRowsParams(), context()).sources
    shift = (moved["x_arcsec"] - still["x_arcsec"]).to_numpy()
    assert np.allclose(shift[::2], shift[1::2])
    assert 0.0 < np.abs(shift).max() <= 2.0
    assert len(np.unique(shift.round(9))) == 18


def test_pairs_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValidationError, match="must lie within 10′ of the axis"):
        PairRowsParams(pair_spacing_arcmin=6.0)


def test_flux_grid_gives_every_flux_the_same_number_of_separate_nodes() -> None:
    params = FluxGridParams()
    sources = draw_sky(params, context()).sources
    assert set(sources["flux_cgs"].value_counts()) == {6}
    assert np.allclose(sorted(set(sources["flux_cgs"])), np.geomspace(1e-16, 1e-13, 13))
    xy_arcsec = sources[["x_arcsec", "y_arcsec"]].to_numpy()
    distance = np.hypot(*(xy_arcsec[:, None] - xy_arcsec[None]).T) + 1e9 * np.eye(len(sources))
    assert distance.min() > 120.0 - 4.0 * np.sqrt(2.0)
    assert np.hypot(*xy_arcsec.T).max() < 603.0


def test_flux_grid_deals_the_nodes_differently_in_every_realisation() -> None:
    one, other = (draw_sky(FluxGridParams(jitter_arcsec=0.0), context(key)).sources for key in "ab")
    assert not np.allclose(one["x_arcsec"], other["x_arcsec"])
    assert np.allclose(one["flux_cgs"], other["flux_cgs"])


def test_flux_grid_can_be_extended_and_refuses_too_few_nodes() -> None:
    sources = draw_sky(FluxGridParams(fluxes_cgs=(1e-14,), source="extended"), context()).sources
    assert (sources["kind"] == "extended").all()
    with pytest.raises(ValidationError, match="30 fluxes need as many nodes"):
        FluxGridParams(n_fluxes=30, spacing_arcmin=5.0)
    with pytest.raises(BadInput, match="half of the image"):
        draw_sky(FluxGridParams(radius_arcmin=20.0), context())


def test_core_radii_are_those_of_the_papers_table() -> None:
    printed_arcsec = [32.8, 31.3, 30.4, 29.7, 29.3, 29.1, 29.0, 29.0, 29.1, 29.2, 29.4, 29.6, 29.9, 30.2, 30.5]
    params = ClustersParams(redshifts=tuple(TABLE_2[:, 0]))
    # 0.1″ is the last printed digit, truncated or rounded
    assert np.abs(core_radii_arcsec(params) - printed_arcsec).max() <= 0.11


def test_the_texts_core_radius_is_twice_the_tables() -> None:
    table, text = (core_radii_arcsec(ClustersParams(h_reading=reading)) for reading in ("table2", "text"))
    assert np.allclose(text, 2.0 * table)


def test_flat_lambda_cosmology_differs_from_the_papers() -> None:
    # D_A(z = 1) of Planck Collaboration 2020 is 1697.8 Mpc (Ωm 0.3097, H₀ 67.66)
    assert angle_arcsec(250.0, 1.0, "planck18") == pytest.approx(206264.8 * 0.250 / 1697.8, rel=0.002)


def test_cluster_rates_pass_through_the_table_and_between() -> None:
    assert np.allclose(count_rates(TABLE_2[:, 0], "soft"), TABLE_2[:, 1])
    assert np.allclose(count_rates(TABLE_2[:, 0], "hard"), TABLE_2[:, 2])
    assert 0.0963 < count_rates(np.array([0.65]), "soft")[0] < 0.1316


def test_test_4_clusters_have_the_papers_input_counts() -> None:
    sources = draw_sky(ClustersParams(), context()).sources
    assert np.allclose(sources["rate_cps"] * 1e4, [1316, 465, 200, 137, 109])
    xy_arcmin = sources[["x_arcsec", "y_arcsec"]].to_numpy() / 60.0
    distance = np.hypot(*(xy_arcmin[:, None] - xy_arcmin[None]).T) + 1e9 * np.eye(5)
    assert distance.min() >= 4.0
    assert np.hypot(*xy_arcmin.T).max() <= 8.0


def test_clusters_can_be_placed_by_hand() -> None:
    sources = draw_sky(ClustersParams(redshifts=(1.0,), positions_arcmin=((3.0, -4.0),)), context(band=HARD)).sources
    assert sources[["x_arcsec", "y_arcsec", "rate_cps"]].iloc[0].tolist() == pytest.approx([180.0, -240.0, 0.0107])
    with pytest.raises(ValidationError, match="one position for each of the 5 redshifts"):
        ClustersParams(positions_arcmin=((0.0, 0.0),))
    with pytest.raises(BadInput, match="the image ends at"):
        draw_sky(ClustersParams(redshifts=(1.0,), positions_arcmin=((30.0, 0.0),)), context())


def test_clusters_that_do_not_fit_say_so() -> None:
    with pytest.raises(BadInput, match=r"do not fit a circle of 8′"):
        draw_sky(ClustersParams(min_separation_arcmin=20.0), context())


def test_image_of_fluxes_becomes_rates() -> None:
    sky = draw_sky(ImageParams(path="tiny.fits", quantity="flux", scale_arcsec=2.0, factor=1e-10), context())
    assert len(sky.sources) == 0
    assert np.allclose(sky.images[0].rate_cps, 1e-14 / 6.70e-13)
    assert sky.images[0].scale_arcsec == 2.0


def test_unopened_or_negative_image_is_refused() -> None:
    with pytest.raises(BadInput, match=r"opened: tiny\.fits"):
        draw_sky(ImageParams(path="other.fits", scale_arcsec=4.0), context())
    bad = context()
    bad.images["tiny.fits"].rate_cps[0, 0] = -1.0
    with pytest.raises(BadInput, match="0 or larger"):
        draw_sky(ImageParams(path="tiny.fits", scale_arcsec=4.0), bad)


def test_empty_sky_has_no_sources() -> None:
    assert len(draw_sky(EmptyParams(), context()).sources) == 0


def test_adding_clusters_leaves_the_points_where_they_were() -> None:
    points = draw_sky(LogNLogSParams(), context()).sources
    both = draw_sky(CombinedParams(parts=(LogNLogSParams(), ClustersParams())), context()).sources
    assert both.head(len(points)).equals(points)
    assert (both["kind"].tail(5) == "extended").all()


def test_two_parts_of_a_kind_are_independent() -> None:
    part = LogNLogSParams(flux_min_cgs=1e-15)
    both = draw_sky(CombinedParams(parts=(part, part)), context()).sources
    assert both["x_arcsec"].is_unique


def test_combination_of_nothing_but_empty_parts_is_empty() -> None:
    sky = draw_sky(CombinedParams(parts=(EmptyParams(), EmptyParams())), context())
    assert len(sky.sources) == 0
    assert tuple(sky.sources.columns) == SKY_COLUMNS


def test_sky_of_a_campaign_is_chosen_by_its_kind() -> None:
    class Campaign(BaseModel):
        sky: AnySkyParams

    parts = [{"kind": "lognlogs"}, {"kind": "clusters"}]
    assert Campaign(sky={"kind": "combined", "parts": parts}).sky.parts[1].kind == "clusters"
    with pytest.raises(ValidationError, match=r"sky\.combined\.parts\.0\n.*'combined' found"):
        Campaign(sky={"kind": "combined", "parts": [{"kind": "combined", "parts": parts}]})
    with pytest.raises(ValidationError, match="'lognlogs', 'pair_rows', 'flux_grid'"):
        Campaign(sky={"kind": "lognlog"})
    with pytest.raises(ValidationError, match=r"sky\.lognlogs\.flux_min_cgs"):
        Campaign(sky={"kind": "lognlogs", "flux_min_cgs": -1.0})


@pytest.mark.parametrize("name", SKIES.names)
def test_every_parameter_is_described(name: str) -> None:
    fields = SKIES[name].params.model_fields
    assert all(info.description for key, info in fields.items() if key != "kind")


def test_designed_sources_stay_in_the_field() -> None:
    for name in ("pair_rows", "flux_grid", "clusters"):
        sources = draw_sky(SKIES[name].params(), context()).sources
        assert sources[["x_arcsec", "y_arcsec"]].abs().to_numpy().max() < HALF_WIDTH_ARCSEC


def test_another_instrument_sees_the_same_cluster_at_its_own_rate() -> None:
    weaker = Band("soft", 0.5, 2.0, 6.70e-12)
    epic = draw_sky(ClustersParams(), context(band=SOFT)).sources
    other = draw_sky(ClustersParams(), context(band=weaker)).sources
    assert np.allclose(other["flux_cgs"], epic["flux_cgs"], rtol=1e-12)
    assert np.allclose(other["rate_cps"], epic["rate_cps"] / 10.0, rtol=1e-12)
