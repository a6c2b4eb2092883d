"""Doing the work: what is missing, one task of it on a worker, the executors, the journal."""

from survey_mc.run.engine import RunSummary, run_campaign
from survey_mc.run.harvest import Progress
from survey_mc.run.image import ImageDetections, detect_image
from survey_mc.run.opened import Run, open_run
from survey_mc.run.plan.campaign_plan import CampaignPlan, plan_campaign
from survey_mc.run.quarantine.limits import FieldLimits
from survey_mc.run.simulate import simulate_field
from survey_mc.run.verify.check import VerifyResult, verify_run

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
