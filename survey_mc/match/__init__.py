"""Who is who: detections against the true sources, by position and by the origin of the photons.

What compares catalogues loads when it is first used: a campaign that only needs the parameters does not wait for the
compiler.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from survey_mc.match.params import MATCH_VERSION, MatchParams

if TYPE_CHECKING:
    from survey_mc.match.chance import ChanceMatches, chance_matches, chance_probability, completeness_without_chance
    from survey_mc.match.matching import Matched, match_field
    from survey_mc.match.outcome import STATUSES

_HOMES = {
    "ChanceMatches": "chance",
    "chance_matches": "chance",
    "chance_probability": "chance",
    "completeness_without_chance": "chance",
    "Matched": "matching",
    "match_field": "matching",
    "STATUSES": "outcome",
}

__all__ = [
    "MATCH_VERSION",
    "STATUSES",
    "ChanceMatches",
    "MatchParams",
    "Matched",
    "chance_matches",
    "chance_probability",
    "completeness_without_chance",
    "match_field",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
