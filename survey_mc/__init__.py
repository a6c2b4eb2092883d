"""survey_mc: Monte-Carlo completeness of X-ray source surveys.

The names below are the public interface; they load what they need when they are first used, so that the import itself
is quick. The rooms of the package are `sky`, `telescope`, `detect`, `match`, `stats`, `campaign`, `store`, `run`,
`report`, `fits` and `testing`, the conformance kit for detection procedures.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from survey_mc.campaign import load_campaign, parse_campaign
    from survey_mc.report import make_report
    from survey_mc.run import detect_image, open_run, plan_campaign, run_campaign, simulate_field, verify_run

_HOMES = {
    "load_campaign": "survey_mc.campaign",
    "parse_campaign": "survey_mc.campaign",
    "plan_campaign": "survey_mc.run",
    "run_campaign": "survey_mc.run",
    "open_run": "survey_mc.run",
    "verify_run": "survey_mc.run",
    "simulate_field": "survey_mc.run",
    "detect_image": "survey_mc.run",
    "make_report": "survey_mc.report",
}

__all__ = [
    "__version__",
    "detect_image",
    "load_campaign",
    "make_report",
    "open_run",
    "parse_campaign",
    "plan_campaign",
    "run_campaign",
    "simulate_field",
    "verify_run",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
