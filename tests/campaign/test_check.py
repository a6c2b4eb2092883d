"""What no single key can tell is still refused when the campaign is loaded, quickly and before anything is drawn."""

from __future__ import annotations

import pytest
from small_campaigns import TEXT, small

from survey_mc.campaign import parse_campaign
from survey_mc.errors import BadInput

SKY = 'kind = "lognlogs"\nflux_min_cgs = 1e-15'
WIDE = ("n_pix = 128", "n_pix = 512\nscale_arcsec = 60.0\nvignetting = false")

REFUSED = {
    "relation without the band": (
        [('["soft"]', '["hard"]'), (SKY, SKY + '\nmodel = "hasinger1998"')],
        "sky.model: no relation is given for the hard band",
    ),
    "vignetting that is no probability": (
        [("n_pix = 128", "n_pix = 128\nvignetting_coefficients = { soft = [1.0, 1.0, 1.0, 1.0] }")],
        "instrument.vignetting_coefficients.soft",
    ),
    "hundreds of millions of sources": ([WIDE, ("1e-15", "1e-18")], "sky.flux_min_cgs: gives"),
    "more photons than memory": (
        [("n_pix = 128", "n_pix = 128\nbackground_cps_per_pix = { soft = 1e3 }")],
        "grid: cell xmm_epic-soft-10ks has 1.48e+11 photons",
    ),
    "infinitely many photons": (
        [(SKY, 'kind = "flux_grid"\nfluxes_cgs = [1e300]\nradius_arcmin = 4.0')],
        "grid: cell xmm_epic-soft-10ks has inf photons",
    ),
    "grid larger than the image": ([(SKY, 'kind = "flux_grid"\nradius_arcmin = 20.0')], "sky.radius_arcmin: must be"),
    "labels of exposures that look the same": ([("[10.0]", "[10.0, 10.0000001]")], "grid: exposure_ks must differ"),
    "more fields than a lifetime": (
        [("[10.0]", "[10.0, 20.0]"), ("realisations = 6", "realisations = 9000000")],
        "grid: has 18000000 fields",
    ),
    "more files than a disk likes": (
        [("realisations = 6", "realisations = 9000000")],
        "grid: the results would be 9000000",
    ),
    "background that the instrument does not grant": (
        [('name = "gauss_se"', 'name = "gauss_se"\nparams = { background = "granted" }')],
        'method[0].params.background: "granted" needs an instrument that grants',
    ),
    "date": ([("seed = 7", "seed = 1979-05-27")], "seed: must not be a date"),
    "control character in a label": ([('"G"', '"a\\u001b[31m"')], "method[0].label: must be one line"),
    "kind of sky that is not known": ([('"lognlogs"', '"lognlog"')], "sky.kind: unknown kind 'lognlog'"),
    "sky without a kind": ([('kind = "lognlogs"\n', "")], "sky.kind: is missing"),
}


@pytest.mark.parametrize("case", REFUSED, ids=lambda name: name.replace(" ", "_"))
def test_it_is_refused_in_one_sentence(case: str) -> None:
    changes, sentence = REFUSED[case]
    with pytest.raises(BadInput) as caught:
        small(*changes)

    assert str(caught.value).startswith(f"small.toml: {sentence}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text", ["a" + ".a" * 40_000 + " = 1", "[" + "a." * 40_000 + "a]\nb = 1", "a" + ".a" * 100 + " = 1"]
)
def test_a_key_of_many_parts_is_refused_before_it_costs_anything(text: str) -> None:
    with pytest.raises(BadInput, match=r"dots in a row|nested more than"):
        parse_campaign(text)


def test_one_bad_value_is_one_error() -> None:
    with pytest.raises(BadInput) as caught:
        small(("[10.0]", "[-10.0]"))

    assert "more)" not in str(caught.value)


def test_many_unknown_keys_are_counted_quickly() -> None:
    with pytest.raises(BadInput, match="and 900 more"):
        parse_campaign(TEXT.replace("schema = 1", "schema = 1\n" + "\n".join(f"k{i} = 1" for i in range(901))))
