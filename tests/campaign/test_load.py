"""Every bad campaign gets one sentence: file, place, value, what is allowed. Nothing is written."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from small_campaigns import MR1, TEXT, small

from survey_mc.campaign import load_campaign, parse_campaign
from survey_mc.errors import BadInput

BAD = {
    "unknown key": (("seed = 7", "seed = 7\nsead = 8"), "sead: is not a known key", "did you mean 'seed'?"),
    "misspelt key": (("seed = 7", "sead = 7"), "sead: is not a known key", "did you mean 'seed'?"),
    "unknown key in a table": (
        ("realisations = 6", "realisations = 6\nexposure_s = 3"),
        "grid.exposure_s",
        "exposure_ks",
    ),
    "unknown key in the sky": (("flux_min_cgs = 1e-15", "flux_mni_cgs = 1e-15"), "sky.flux_mni_cgs", "flux_min_cgs"),
    "unknown key in the match": (("region_arcmin", "region_arcmim"), "match.region_arcmim", "region_arcmin"),
    "wrong type": (("realisations = 6", 'realisations = "six"'), "grid.realisations", "'six'"),
    "fraction of a realisation": (("realisations = 6", "realisations = 6.5"), "grid.realisations", "6.5"),
    "truth value as a number": (("realisations = 6", "realisations = true"), "grid.realisations", "True"),
    "negative exposure": (("[10.0]", "[-10.0]"), "grid.exposure_ks[0]", "greater than 0"),
    "zero exposure": (("[10.0]", "[0.0]"), "grid.exposure_ks[0]", "greater than 0"),
    "infinite exposure": (("[10.0]", "[inf]"), "grid.exposure_ks[0]", "inf"),
    "exposure that is no number": (("[10.0]", "[nan]"), "grid.exposure_ks[0]", "nan"),
    "absurd exposure": (("[10.0]", "[1e9]"), "grid.exposure_ks[0]", "5000"),
    "no exposure": (("[10.0]", "[]"), "grid.exposure_ks", "at least 1"),
    "repeated exposure": (("[10.0]", "[10.0, 10.0]"), "grid", "must not repeat"),
    "1e18 realisations": (("= 6", "= 1000000000000000000"), "grid.realisations", "10000000"),
    "no realisation": (("realisations = 6", "realisations = 0"), "grid.realisations", "greater than or equal to 1"),
    "unknown band": (('"soft"', '"medium"'), "grid.band[0]", "'soft' or 'hard'"),
    "unknown method": (('"gauss_se"', '"gaus_se"'), "method[0].name", "did you mean 'gauss_se'?"),
    "unknown parameter": (('label = "G"', "params = { fwhm = 3 }"), "method[0].params.fwhm", "fwhm_arcsec"),
    "parameter out of range": (('label = "G"', "params = { fwhm_arcsec = -3 }"), "method[0].params.fwhm_arcsec", "-3"),
    "parameter of the wrong type": (
        ('label = "G"', 'params = { minarea_pix = "5" }'),
        "method[0].params.minarea_pix",
        "'5'",
    ),
    "truth value as an exposure": (("[10.0]", "[true]"), "grid.exposure_ks[0]", "True"),
    "text as a flux": (("flux_min_cgs = 1e-15", "margin_arcmin = true"), "sky.margin_arcmin", "True"),
    "parameters that are no table": (('label = "G"', "params = 3"), "method[0].params", "table"),
    "scales that do not fit the image": (
        ('name = "gauss_se"\nlabel = "G"', 'name = "mr1_se"\nparams = { n_scales = 8 }'),
        "method[0].params",
        "n_scales must be 2..6 for a 128-pixel image (got 8)",
    ),
    "unknown profile": (('label = "G"', 'profile = "papr"'), "method[0].profile", "did you mean 'paper'?"),
    "unknown instrument": (('"xmm_epic"', '"xmm_epik"'), "instrument.name", "did you mean 'xmm_epic'?"),
    "unknown sky": (('"lognlogs"', '"lognlog"'), "sky", "lognlogs"),
    "wrong unit": (("[10.0]", '["10 parsec"]'), "grid.exposure_ks[0]", "a time"),
    "unit of another kind": (("region_arcmin = 4.0", 'region_arcmin = "4 ks"'), "match.region_arcmin", "an angle"),
    "text without a unit": (("region_arcmin = 4.0", 'region_arcmin = "wide"'), "match.region_arcmin", "an angle"),
    "name with a path": (('name = "small"', 'name = "../small"'), "name", "'../small'"),
    "absolute name": (('name = "small"', 'name = "/etc/small"'), "name", "'/etc/small'"),
    "hidden name": (('name = "small"', 'name = ".ssh"'), "name", "'.ssh'"),
    "empty name": (('name = "small"', 'name = ""'), "name", "''"),
    "missing table": (("[grid]", "[grud]"), "", "grid"),
    "other file format": (("schema = 1", "schema = 2"), "schema", "1"),
    "negative seed": (("seed = 7", "seed = -7"), "seed", "-7"),
    "no count limit for an exposure": (("counts_min = 10", "counts_min = { 100 = 30 }"), "", "10 ks"),
    "not TOML": (("schema = 1", "schema : 1"), "", "is not TOML"),
}


@pytest.mark.parametrize("case", BAD, ids=lambda name: name.replace(" ", "_"))
def test_a_bad_campaign_is_refused_with_file_place_and_cause(case: str) -> None:
    change, place, cause = BAD[case]
    with pytest.raises(BadInput) as caught:
        small(change)

    sentence = str(caught.value)
    assert sentence.startswith(f"small.toml: {place}")
    assert cause in sentence
    assert "\n" not in sentence
    assert len(sentence) < 1200


def test_methods_need_labels_of_their_own() -> None:
    with pytest.raises(BadInput, match="labelled 'G'"):
        small(extra=MR1.replace('"M"', '"G"'))


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"a = [" + b"[" * 5000, b"a" * 2_000_000])
def test_a_file_that_is_no_campaign_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(content)

    with pytest.raises(BadInput, match=r"bad\.toml"):
        load_campaign(path)


def test_what_is_not_a_file_is_refused(tmp_path: Path) -> None:
    fifo = tmp_path / "pipe.toml"
    os.mkfifo(fifo)
    for path in (tmp_path / "missing.toml", tmp_path, fifo, Path("/dev/zero"), tmp_path / ("x" * 300)):
        with pytest.raises(BadInput):
            load_campaign(path)


def test_a_text_with_a_unit_is_converted() -> None:
    campaign = small(("[10.0]", '["10000 s"]'), ("region_arcmin = 4.0", 'region_arcmin = "240 arcsec"'))

    assert campaign.grid.exposure_ks == pytest.approx((10.0,))
    assert campaign.match.region_arcmin == pytest.approx(4.0)


def test_one_band_and_one_exposure_may_be_given_without_a_list() -> None:
    campaign = small(('["soft"]', '"soft"'), ("[10.0]", "10.0"))

    assert campaign.grid.band == ("soft",)
    assert campaign.grid.exposure_ks == (10.0,)


@pytest.mark.parametrize(
    "path", ["../up.fits", "/etc/passwd", "~/x.fits", "a\\u0000b", "link.fits", "gone.fits", "file://x"]
)
def test_a_sky_image_must_stay_below_the_campaign(tmp_path: Path, path: str) -> None:
    (tmp_path / "inside").mkdir()
    (tmp_path / "up.fits").write_bytes(b"x")
    (tmp_path / "inside" / "link.fits").symlink_to(tmp_path / "up.fits")
    sky = f'kind = "image"\npath = "{path}"\nscale_arcsec = 4.0'
    text = TEXT.replace('kind = "lognlogs"\nflux_min_cgs = 1e-15', sky)

    with pytest.raises(BadInput, match="sky image"):
        parse_campaign(text, "small.toml", tmp_path / "inside")


@pytest.mark.parametrize("path", sorted(Path("campaigns").glob("*.toml")), ids=lambda path: path.stem)
def test_the_campaigns_of_the_project_are_good(path: Path) -> None:
    assert load_campaign(path).name == path.stem
