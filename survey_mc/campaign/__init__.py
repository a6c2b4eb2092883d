"""What is asked for: a validated campaign file, the cells it expands to, and the keys of all it makes."""

from survey_mc.campaign.cells import Cell, CellMethod, expand
from survey_mc.campaign.draw import draw_field, draw_truth
from survey_mc.campaign.load import load_campaign, load_run_campaign, parse_campaign
from survey_mc.campaign.lock import lock_content
from survey_mc.campaign.resize import load_resized
from survey_mc.campaign.schema import Campaign, json_schema

__all__ = [
    "Campaign",
    "Cell",
    "CellMethod",
    "draw_field",
    "draw_truth",
    "expand",
    "json_schema",
    "load_campaign",
    "load_resized",
    "load_run_campaign",
    "lock_content",
    "parse_campaign",
]
