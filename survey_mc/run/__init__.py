"""Doing the work: what is missing, one task of it on a worker, the executors, the journal.

The names below load what they need when they are first used: to say how a run stands takes no compiler.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from survey_mc.lazy_names import lazy_names

if TYPE_CHECKING:
    from survey_mc.run.engine import RunSummary, run_campaign
    from survey_mc.run.harvest import Progress
    from survey_mc.run.image import ImageDetections, detect_image
    from survey_mc.run.opened import Run, open_run
    from survey_mc.run.plan.campaign_plan import CampaignPlan, plan_campaign
    from survey_mc.run.quarantine.limits import FieldLimits
    from survey_mc.run.simulate import simulate_field
    from survey_mc.run.verify.check import VerifyResult, verify_run

_HOMES = {
    "CampaignPlan": "plan.campaign_plan",
    "FieldLimits": "quarantine.limits",
    "ImageDetections": "image",
    "Progress": "harvest",
    "Run": "opened",
    "RunSummary": "engine",
    "VerifyResult": "verify.check",
    "detect_image": "image",
    "open_run": "opened",
    "plan_campaign": "plan.campaign_plan",
    "run_campaign": "engine",
    "simulate_field": "simulate",
    "verify_run": "verify.check",
}

__getattr__ = lazy_names(__name__, _HOMES)

__all__ = [
    "CampaignPlan",
    "FieldLimits",
    "ImageDetections",
    "Progress",
    "Run",
    "RunSummary",
    "VerifyResult",
    "detect_image",
    "open_run",
    "plan_campaign",
    "run_campaign",
    "simulate_field",
    "verify_run",
]


def __dir__() -> list[str]:
    return sorted(__all__)
