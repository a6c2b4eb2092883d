"""The same campaign with another number of realisations: its text with one number changed.

Idea     a run directory keeps its campaign verbatim, so the change is made in the text, comments and all, and the text
         is checked like any other. Realisations that both have are the same fields.
"""

from __future__ import annotations

import re
from pathlib import Path

from survey_mc.campaign.load import parse_campaign, read_campaign_text
from survey_mc.campaign.schema import Campaign
from survey_mc.errors import BadInput

_REALISATIONS = re.compile(r"^(\s*realisations\s*=\s*)[0-9_]+", re.MULTILINE)


def load_resized(path: Path | str, realisations: int) -> Campaign:
    """Read a campaign file as if it asked for `realisations` fields of each cell; raises `BadInput`."""
    text = read_campaign_text(path)
    resized, n_places = _REALISATIONS.subn(rf"\g<1>{realisations}", text)
    if n_places != 1:
        raise BadInput(str(path), f"must have one line `realisations = …` in its [grid] (found {n_places})")
    return parse_campaign(resized, str(path), Path(path).parent)
