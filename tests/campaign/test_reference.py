"""The reference of campaign files says what the models say."""

from __future__ import annotations

from pathlib import Path

from survey_mc.campaign.reference import reference


def test_the_reference_is_what_the_models_give() -> None:
    assert Path("campaigns/README.md").read_text(encoding="utf-8") == reference()


def test_every_key_has_a_meaning() -> None:
    assert "|  |" not in reference()
