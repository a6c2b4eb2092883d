"""A result's name depends on what made it and on nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from small_campaigns import MR1, small

from survey_mc.campaign import Campaign, draw_field, draw_truth, expand


def keys(campaign: Campaign) -> tuple[str, str, str]:
    cell = expand(campaign)[0]
    return cell.field_key, cell.methods[0].detect_key, cell.methods[0].match_key


@pytest.mark.parametrize(
    "change",
    [
        ('label = "G"', 'label = "another label"'),
        ('name = "small"', 'name = "other"\nabout = "a comment"  # and another'),
        ("realisations = 6", "realisations = 60"),
        ('["soft"]', '["soft", "hard"]'),
        ("[10.0]", "[10.0, 30.0]"),
        ("counts_min = 10", "counts_min = { 10 = 10, 30 = 20 }"),
        ("realisations_per_file = 4", "realisations_per_file = 8"),
        ("field_of_view = false", "field_of_view = false\npointing_deg = [150.0, 2.0]"),
        ("counts_min = 10", 'counts_min = 10\nrule = "origin"'),
        ('kind = "lognlogs"', 'kind = "lognlogs"\nmodel = { soft = "hasinger1998", hard = "moretti2003" }'),
    ],
)
def test_what_no_result_depends_on_changes_no_key(change: tuple[str, str]) -> None:
    assert keys(small(change)) == keys(small())


@pytest.mark.parametrize(
    ("change", "changed"),
    [
        (("seed = 7", "seed = 8"), 3),
        (("flux_min_cgs = 1e-15", "flux_min_cgs = 2e-15"), 3),
        (("field_of_view = false", "vignetting = false"), 3),
        (("field_of_view = false", "field_of_view = false\nbackground_cps_per_pix = { soft = 1e-5 }"), 3),
        (("[10.0]", "[10.5]"), 3),
        (("field_of_view = false", "field_of_view = false\ngrants_background = true"), 2),
        (('label = "G"', 'label = "G"\nparams = { fwhm_arcsec = 20.0 }'), 2),
        (("counts_min = 10", "counts_min = 12"), 1),
        (("counts_min = 10", "counts_min = 10\nradius_arcsec = 8.0"), 1),
    ],
)
def test_a_changed_number_changes_the_keys_of_what_depends_on_it(change: tuple[str, str], changed: int) -> None:
    differ = [a != b for a, b in zip(keys(small(change)), keys(small()), strict=True)]

    assert differ == [False] * (3 - changed) + [True] * changed


def test_a_second_method_changes_nothing_of_the_first() -> None:
    assert keys(small(extra=MR1)) == keys(small())


def test_bands_and_exposures_of_a_realisation_share_the_sky() -> None:
    campaign = small(('["soft"]', '["soft", "hard"]'), ("[10.0]", "[10.0, 100.0]"))
    short, deep, hard, _ = (draw_truth(campaign, cell, 3).sources for cell in expand(campaign))
    n = min(len(short), len(hard))

    assert short.equals(deep)
    np.testing.assert_array_equal(short["x_arcsec"][:n], hard["x_arcsec"][:n])


def test_a_field_is_a_function_of_its_keys() -> None:
    campaign = small()
    cell = expand(campaign)[0]
    first, again, other = (draw_field(campaign, cell, number) for number in (2, 2, 3))

    np.testing.assert_array_equal(first.observation.counts, again.observation.counts)
    assert first.truth.equals(again.truth)
    assert not np.array_equal(first.observation.counts, other.observation.counts)
