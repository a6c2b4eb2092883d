"""survey_mc: Monte-Carlo completeness of X-ray source surveys.

The names below are the public interface; they load what they need when they are first used, so that the import itself
is quick. The rooms of the package are `sky`, `telescope`, `detect`, `match`, `stats`, `campaign`, `store`, `run`,
`report`, `fits` and `testing`, the conformance kit for detection procedures.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from survey_mc.lazy_names import lazy_names

__version__ = "0.1.0"

if TYPE_CHECKING:
    from survey_mc.campaign import load_campaign, parse_campaign
    from survey_mc.report import make_report
    from survey_mc.run import detect_image, open_run, plan_campaign, run_campaign, simulate_field, verify_run

_HOMES = {
    "load_campaign": "campaign",
    "parse_campaign": "campaign",
    "plan_campaign": "run",
    "run_campaign": "run",
    "open_run": "run",
    "verify_run": "run",
    "simulate_field": "run",
    "detect_image": "run",
    "make_report": "report",
}

__getattr__ = lazy_names(__name__, _HOMES)

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


def __dir__() -> list[str]:
    return sorted(__all__)
