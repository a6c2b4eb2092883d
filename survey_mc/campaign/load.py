"""From a TOML file to a `Campaign`, or to one sentence that says what is wrong with it.

Limits   a campaign is at most 100 kB of text, ten times the longest that we wrote; the parser needs 3 kB of memory for
         each part of a dotted key. Parsing has no side effects and follows no reference to another file.
"""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from survey_mc.campaign.check import check_campaign
from survey_mc.campaign.inputs import input_digests
from survey_mc.campaign.quantities import MAX_NESTING, convert_quantities
from survey_mc.campaign.schema import Campaign
from survey_mc.campaign.sentences import sentence_of
from survey_mc.errors import BadInput, DamagedStore
from survey_mc.files import read_regular
from survey_mc.lock_form import loose_content

MAX_CAMPAIGN_BYTES = 100_000
MAX_DOTS = 200  # in one dotted key; the parser takes seconds and gigabytes over a key of 10⁵ parts
_KEY_END = re.compile(r"[=,\[\]{}\n]")
_COMMENT_LINE = re.compile(r"^[ \t]*#.*$", re.MULTILINE)
_LONG_NUMBER = re.compile(r"\d[\d_]{4000}")  # Python reads no integer of more than 4300 digits


def read_campaign_text(path: Path | str) -> str:
    """Text of a campaign file; refuses what is not a regular, small UTF-8 file."""
    try:
        return read_regular(path, MAX_CAMPAIGN_BYTES).decode("utf-8")
    except FileNotFoundError:
        raise BadInput(str(path), "there is no such file; give the path of a campaign file (TOML)") from None
    except UnicodeDecodeError as problem:
        raise BadInput(str(path), f"is not UTF-8 text (byte {problem.start})") from None
    except OSError as problem:
        advice = "give the path of a campaign file (TOML)"
        raise BadInput(str(path)[:200], f"cannot be read ({problem.strerror or problem}); {advice}") from None


def load_campaign(path: Path | str) -> Campaign:
    """Read and check a campaign file; raises `BadInput` with file, place, value and what is allowed."""
    return parse_campaign(read_campaign_text(path), str(path), Path(path).parent)


def load_run_campaign(run_dir: Path) -> Campaign:
    """The campaign a run directory was made with, from the copy it keeps; `DamagedStore` if that was changed."""
    path = run_dir / "campaign.toml"
    if not path.is_file():
        raise BadInput(str(run_dir), "is not a run directory (it has no campaign.toml)")
    lock, _ = loose_content(run_dir / "campaign.lock.json")
    try:
        campaign_sha256, inputs_sha256 = lock["campaign_sha256"], lock["inputs_sha256"]
    except KeyError:
        raise DamagedStore(f"{run_dir}: its campaign.lock.json is missing or damaged; run the campaign again") from None
    remedy = "is not what the run was made with; `survey-mc run` with the campaign file writes it again"
    text = read_campaign_text(path)
    if hashlib.sha256(text.encode()).hexdigest() != campaign_sha256:
        raise DamagedStore(f"{path}: {remedy}")
    campaign = parse_campaign(text, str(path), run_dir / "inputs")
    if campaign.input_digests != inputs_sha256:
        raise DamagedStore(f"{run_dir / 'inputs'}: {remedy}")
    return campaign


def parse_campaign(text: str, where: str = "campaign", folder: Path | None = None) -> Campaign:
    """Check the text of a campaign; `where` names it in errors, `folder` is what its paths are relative to."""
    _refuse_costly(text, where)
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise BadInput(where, f"is not TOML: {problem}") from None
    except (RecursionError, ValueError) as problem:
        raise BadInput(where, f"is not TOML that can be read: {str(problem)[:120]}") from None
    campaign = _validate(convert_quantities(content, where), where)
    campaign._text = text
    campaign._folder = folder or Path()
    campaign._input_digests = input_digests(campaign, campaign.folder, where)
    check_campaign(campaign, where)
    return campaign


def _refuse_costly(text: str, where: str) -> None:
    """Raise `BadInput`, with the line, for what the TOML parser would take too long over or cannot survive."""
    if len(text) > MAX_CAMPAIGN_BYTES:
        raise BadInput(where, f"must be at most {MAX_CAMPAIGN_BYTES} characters long (got {len(text)})")
    if max(text.count("["), text.count("{")) > MAX_NESTING and (place := _too_deep(text)) is not None:
        raise BadInput(_line(text, place, where), f"is nested more than {MAX_NESTING} levels deep")
    for part in _KEY_END.split(_COMMENT_LINE.sub("", text)):
        if part.count(".") > MAX_DOTS:
            place = text.find(part)  # not found if a comment is inside
            raise BadInput(
                _line(text, max(place, 0), where),
                f"has more than {MAX_DOTS} dots in a row without one of = , [ ] {{ }} between them",
            )
    if number := _LONG_NUMBER.search(text):
        raise BadInput(_line(text, number.start(), where), "has a number of more than 4000 digits")


def _line(text: str, place: int, where: str) -> str:
    return f"{where}: line {text.count(chr(10), 0, place) + 1}"


def _too_deep(text: str) -> int | None:
    """Where the brackets are first nested too deep; those in texts and comments count, which campaigns do not need."""
    depth = 0
    for place, character in enumerate(text):
        if character in "[{":
            depth += 1
            if depth > MAX_NESTING:
                return place
        elif character in "]}":
            depth -= 1
    return None


def _validate(content: dict[str, Any], where: str) -> Campaign:
    try:
        # Strict JSON rules: whole numbers may stand for fractions and arrays for tuples, nothing else is converted.
        text = json.dumps(content)
        return Campaign.model_validate_json(text, strict=True, by_name=False, by_alias=True)
    except ValidationError as error:
        raise BadInput(where, sentence_of(error, Campaign, content)) from None
