"""Units as people write them mean what astropy says; a text that would keep its parser busy for hours is no unit."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from astropy import units
from small_campaigns import TEXT

from survey_mc.campaign import inputs, parse_campaign
from survey_mc.errors import BadInput
from survey_mc.fits.unit_text import unit_from_text

PLAIN = (
    "s", "ks", "arcsec", "µs", "count/pixel", "ct s-1 arcmin-2", "count/s/cm**2", "erg / (s cm2)", "erg.s-1.cm-2",
    "m^(1/2)", "10**-14 erg/s/cm2", "10**(-20) erg s-1 cm-2", "10^3 s", "1e3 s", "0.001 s", "1000 s", "photon s**-1",
    "deg^2", "",
)  # fmt: skip
ENDLESS = (
    "10^1000000000 s", "10**1000000000", "(10)^1000000000", "2^999999999 s", "10^99^99", "(10^99)^99 s",
    "10.^999999999",
    "(((10^99)^99)^99)^99", "1e5**999999999 s", "10 ** ( 999999999 ) s", "10^(99)^99", "s" * 81, "s 10^99 (10^99)^99",
)  # fmt: skip


@pytest.mark.parametrize("words", PLAIN)
@pytest.mark.filterwarnings("ignore::astropy.units.UnitsWarning")
def test_a_plain_unit_is_that_of_astropy(words: str) -> None:
    assert unit_from_text(words) == units.Unit(words)


@pytest.mark.parametrize("words", [*ENDLESS, "furlong per fortnight", "__import__('os')", "s;s", "s\n10^999999999"])
def test_what_is_no_plain_unit_is_refused_at_once(words: str) -> None:
    start = time.process_time()
    with pytest.raises(ValueError, match="is no"):
        unit_from_text(words)

    assert time.process_time() - start < 1.0


def test_the_sky_images_of_a_campaign_have_a_limit_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import numpy as np
    from astropy.io import fits

    for name in "ab":
        fits.PrimaryHDU(np.ones((16, 16))).writeto(tmp_path / f"{name}.fits")
    part = '{{ kind = "image", path = "{}.fits", scale_arcsec = 4.0, factor = 1e-6 }}'
    parts = f'kind = "combined"\nparts = [{part.format("a")}, {part.format("b")}]'
    text = TEXT.replace('kind = "lognlogs"\nflux_min_cgs = 1e-15', parts)
    assert len(parse_campaign(text, "c.toml", tmp_path).input_digests) == 2

    monkeypatch.setattr(inputs, "MAX_PIXELS", 500)
    with pytest.raises(BadInput, match="512 pixels together; at most 500"):
        parse_campaign(text, "c.toml", tmp_path)
