"""From a TOML file to a `Campaign`, or to one sentence that says what is wrong with it.

Limits   a campaign is at most 1 MB of text; parsing has no side effects and follows no reference to another file.
"""

from __future__ import annotations

import hashlib
import json
import re
import stat
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

MAX_CAMPAIGN_BYTES = 1_000_000
_KEY_END = re.compile(r"[=,\[\]{}\n]")
_COMMENT_LINE = re.compile(r"^\s*#.*$", re.MULTILINE)
MAX_DOTS = 200  # in one dotted key; the parser takes seconds and gigabytes over a key of 10⁵ parts


def read_campaign_text(path: Path | str) -> str:
    """Text of a campaign file; refuses what is not a regular, small UTF-8 file."""
    path = Path(path)
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise BadInput(str(path), "is not a regular file; give the path of a campaign file (TOML)")
        if status.st_size > MAX_CAMPAIGN_BYTES:
            raise BadInput(str(path), f"must be at most {MAX_CAMPAIGN_BYTES} bytes long (got {status.st_size})")
        return path.read_bytes().decode("utf-8")
    except FileNotFoundError:
        raise BadInput(str(path), "there is no such file; give the path of a campaign file (TOML)") from None
    except UnicodeDecodeError as problem:
        raise BadInput(str(path), f"is not UTF-8 text (byte {problem.start})") from None
    except (OSError, ValueError) as problem:
        raise BadInput(str(path)[:200], f"cannot be read: {getattr(problem, 'strerror', None) or problem}") from None


def load_campaign(path: Path | str) -> Campaign:
    """Read and check a campaign file; raises `BadInput` with file, place, value and what is allowed."""
    return parse_campaign(read_campaign_text(path), str(path), Path(path).parent)


def load_run_campaign(run_dir: Path) -> Campaign:
    """The campaign a run directory was made with, from the copy it keeps; `DamagedStore` if that was changed."""
    path = run_dir / "campaign.toml"
    if not path.is_file():
        raise BadInput(str(run_dir), "is not a run directory (it has no campaign.toml)")
    try:
        lock = json.loads((run_dir / "campaign.lock.json").read_bytes())
        campaign_sha256, inputs_sha256 = lock["campaign_sha256"], lock["inputs_sha256"]
    except (OSError, ValueError, KeyError, TypeError):
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
    if max(text.count("["), text.count("{")) > MAX_NESTING and _nesting(text) > MAX_NESTING:
        raise BadInput(where, f"is nested more than {MAX_NESTING} levels deep")
    if max(part.count(".") for part in _KEY_END.split(_COMMENT_LINE.sub("", text))) > MAX_DOTS:
        raise BadInput(where, f"has more than {MAX_DOTS} dots in a row without one of = , [ ] {{ }} between them")
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


def _nesting(text: str) -> int:
    depth = deepest = 0
    for character in text:
        if character in "[{":
            depth += 1
            deepest = max(deepest, depth)
        elif character in "]}":
            depth -= 1
    return deepest


def _validate(content: dict[str, Any], where: str) -> Campaign:
    try:
        # Strict JSON rules: whole numbers may stand for fractions and arrays for tuples, nothing else is converted.
        text = json.dumps(content)
        return Campaign.model_validate_json(text, strict=True, by_name=False, by_alias=True)
    except ValidationError as error:
        raise BadInput(where, sentence_of(error, Campaign, content)) from None
