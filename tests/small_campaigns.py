"""Small campaigns for the tests of the engine: 128-pixel fields that take milliseconds."""

from __future__ import annotations

from survey_mc.campaign import Campaign, parse_campaign

TEXT = """
schema = 1
name = "small"
seed = 7

[instrument]
name = "xmm_epic"
n_pix = 128
field_of_view = false

[sky]
kind = "lognlogs"
flux_min_cgs = 1e-15

[grid]
band = ["soft"]
exposure_ks = [10.0]
realisations = 6

[[method]]
name = "gauss_se"
label = "G"

[match]
region_arcmin = 4.0
counts_min = 10

[store]
realisations_per_file = 4
"""

MR1 = """
[[method]]
name = "mr1_se"
label = "M"
params = { n_scales = 5 }
"""


def small(*changes: tuple[str, str], extra: str = "") -> Campaign:
    """The small campaign with texts replaced (each must occur) and more TOML appended."""
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return parse_campaign(text + extra, "small.toml")
