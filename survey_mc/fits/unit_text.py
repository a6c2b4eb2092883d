"""Units as people write them in headers and campaign files.

Idea     the text is held against a narrow form before the parser of astropy sees it: there a power of a number such
         as 10^1000000000 is computed digit by digit, for hours. A power of a number must be one of ten, of at most two
         digits.
Source   FITS standard 4.0, sect. 4.3; the "generic" format of astropy.units.
"""

from __future__ import annotations

import re
import warnings
from typing import Any

MAX_CHARACTERS = 80
_TEN_TO_THE = re.compile(r"10\s*(?:\*\*|\^)\s*(?:[+-]?\d{1,2}|\(\s*[+-]?\d{1,2}\s*\))(?!\s*\d|\s*\*\*|\s*\^)", re.ASCII)
_POWER_OF_A_NUMBER = re.compile(r"[\d.)]\s*(?:\*\*|\^)")


def unit_from_text(words: str) -> Any:
    """The astropy unit that a text means; ValueError for any text that is no plain unit."""
    from astropy import units

    without_factor = _TEN_TO_THE.sub(" ", words)
    if len(words) > MAX_CHARACTERS or _POWER_OF_A_NUMBER.search(without_factor):
        raise ValueError(f"{words[:MAX_CHARACTERS]!r} is no plain unit")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about two slashes in one unit, which is how people write it
            return units.Unit(words)
    except Exception as error:  # the parser is given unknown text and raises several types
        raise ValueError(f"{words!r} is no unit") from error
