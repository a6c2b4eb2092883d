"""What holds for every field: conservation, order, random streams, the truth table, what the observer is told."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_expose import BARE, NO_SKY, field_of, sky_of

from survey_mc.columns import TRUTH
from survey_mc.rng import stream
from survey_mc.telescope import InstrumentSettings
from survey_mc.types import Field, Sky, SkyImage

Z_1E4 = 3.89  # two-sided 1e-4 false alarm of a normal variate
SMALL = {"n_pix": 48}


@st.composite
def small_fields(draw: st.DrawFn) -> Field:
    """Fields of 48 × 48 pixels with up to five sources anywhere near, effects on or off, β-models and images."""
    place = st.floats(-130.0, 130.0)
    sources = draw(st.lists(st.tuples(place, place, st.floats(0.0, 0.3)), max_size=5))
    extended = draw(st.booleans())
    sky = (
        sky_of(*sources, core_radius_arcsec=15.0 if extended else np.nan, beta=0.75 if extended else np.nan)
        if sources
        else NO_SKY
    )
    if draw(st.booleans()):
        sky = Sky(sky.source_rows, (SkyImage(np.full((3, 4), 0.01), 10.0),))
    effects = {name: draw(st.booleans()) for name in ("psf", "vignetting", "background", "field_of_view")}
    instrument = InstrumentSettings(**SMALL, **effects, field_of_view_arcmin=1.5)
    return field_of(sky, instrument, 1000.0, key=str(draw(st.integers(0, 10**6))))


@settings(max_examples=60, deadline=None)
@given(small_fields())
def test_every_photon_is_counted_once(field: Field) -> None:
    n_background = int((field.origin == -1).sum())
    assert field.truth["counts_drawn"].sum() + n_background == field.observation.counts.sum() == len(field.origin)
    drawn = np.bincount(field.origin[field.origin >= 0], minlength=len(field.truth))
    assert np.array_equal(drawn, field.truth["counts_drawn"])


@settings(max_examples=60, deadline=None)
@given(small_fields())
def test_photons_are_in_row_order_and_x_order(field: Field) -> None:
    ny, nx = field.observation.counts.shape
    photons_pix = field.observation.photons_pix
    column, row = np.floor(photons_pix + 0.5).astype(int).T
    pixel = row * nx + column
    assert np.array_equal(np.diff(field.row_start), field.observation.counts.sum(axis=1))
    assert np.array_equal(np.bincount(pixel, minlength=ny * nx), field.observation.counts.ravel())
    assert np.all(np.diff(pixel) >= 0)
    assert np.all(np.diff(photons_pix[:, 0])[np.diff(row) == 0] >= 0.0)
    assert field.observation.counts[field.observation.exposure_s == 0.0].sum() == 0


def test_bright_pixels_are_in_order_too() -> None:
    field = field_of(sky_of((0.3, 0.3, 300.0)), InstrumentSettings(), 1e4)
    photons_pix = field.observation.photons_pix
    column, row = np.floor(photons_pix + 0.5).astype(int).T
    order = np.lexsort((photons_pix[:, 0], column, row))
    assert field.observation.counts.max() > 1e5
    assert np.array_equal(order, np.arange(len(order)))


def test_one_more_source_leaves_the_background_where_it_was() -> None:
    without = field_of(NO_SKY, InstrumentSettings(), 1e4)
    with_source = field_of(sky_of((0.0, 0.0, 1.0)), InstrumentSettings(), 1e4)
    background = with_source.observation.photons_pix[with_source.origin == -1]
    assert np.array_equal(background, without.observation.photons_pix)


def test_an_image_leaves_the_photons_of_the_sources_where_they_were() -> None:
    sky = sky_of((0.0, 0.0, 1.0))
    both = Sky(sky.source_rows, (SkyImage(np.ones((3, 3)), 4.0),))
    photons = [
        field.observation.photons_pix[field.origin == 0]
        for field in (field_of(sky, InstrumentSettings(), 1e4), field_of(both, InstrumentSettings(), 1e4))
    ]
    assert np.array_equal(photons[0], photons[1])


def test_same_key_same_field_other_key_other_field() -> None:
    sky = sky_of((0.0, 0.0, 0.1))
    one, again, other = (field_of(sky, InstrumentSettings(), 1e4, key) for key in ("a", "a", "b"))
    assert np.array_equal(one.observation.photons_pix, again.observation.photons_pix)
    assert one.truth.equals(again.truth)
    difference = (one.observation.counts - other.observation.counts).sum()
    assert one.observation.counts.sum() != other.observation.counts.sum()
    assert abs(difference) < Z_1E4 * np.sqrt(2 * one.observation.counts.sum())


def test_nothing_in_nothing_out() -> None:
    field = field_of(NO_SKY, BARE, 1e4)
    assert field.observation.counts.sum() == len(field.origin) == len(field.truth) == 0
    assert field.observation.photons_pix.shape == (0, 2)
    dark = field_of(sky_of((0.0, 0.0, 0.0)), BARE, 1e4)
    assert dark.truth["counts_drawn"].tolist() == [0]


def test_without_psf_every_photon_lands_on_its_source() -> None:
    field = field_of(sky_of((10.0, -22.0, 1.0)), BARE, 1e3)
    x_arcsec, y_arcsec = ((field.observation.photons_pix - np.array(field.observation.grid.axis_pix)) * 4.0).T
    assert np.hypot(x_arcsec - 10.0, y_arcsec + 22.0).max() < 1e-9


def test_truth_has_the_declared_columns_and_types() -> None:
    for sky in (NO_SKY, sky_of((0.0, 0.0, 1.0)), Sky(NO_SKY.source_rows, (SkyImage(np.ones((2, 2)), 4.0),))):
        truth = field_of(sky, InstrumentSettings(**SMALL), 10.0).truth
        declared = {column.name: column.dtype for column in TRUTH.columns if column.name != "realisation"}
        assert list(truth.columns) == list(declared)
        for name, dtype in declared.items():
            assert dtype == "string" or truth[name].dtype == dtype, name


def test_positions_of_the_truth_agree_with_the_photons() -> None:
    field = field_of(sky_of((123.0, -321.0, 5.0)), BARE, 1e3)
    row = field.truth.iloc[0]
    assert np.allclose(field.observation.photons_pix, [row["x_pix"], row["y_pix"]])
    assert row["offaxis_arcmin"] == pytest.approx(np.hypot(123.0, 321.0) / 60.0)


def test_observer_is_told_the_background_only_if_granted() -> None:
    assert field_of(NO_SKY, InstrumentSettings(**SMALL), 1e3).observation.background is None
    granted = field_of(NO_SKY, InstrumentSettings(**SMALL, grants_background=True), 1e3)
    assert np.array_equal(granted.observation.background, granted.background_expected)


def test_observer_believes_what_the_campaign_says() -> None:
    told = InstrumentSettings(**SMALL, believed_psf={"fwhm_arcsec": 9.0, "hew_arcsec": 20.0})
    assert field_of(NO_SKY, told, 1e3).observation.psf.fwhm_arcsec == pytest.approx(9.0)


def test_arrays_of_a_field_are_read_only() -> None:
    field = field_of(sky_of((0.0, 0.0, 1.0)), InstrumentSettings(**SMALL), 1e3)
    observation = field.observation
    for values in (
        field.origin,
        field.row_start,
        field.background_expected,
        observation.counts,
        observation.photons_pix,
    ):
        assert not values.flags.writeable


def test_streams_of_different_names_are_different() -> None:
    assert stream("k", "photons").random() != stream("k", "background").random()
