"""The reference of campaign files, written from the models themselves.

Idea     `python -m survey_mc.campaign.reference > campaigns/README.md`; a test holds the file to what this prints.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from survey_mc.campaign.schema import Campaign, Grid, MethodChoice, StoreSettings
from survey_mc.detect import DETECTORS
from survey_mc.match import MatchParams
from survey_mc.sky import RELATIONS, SKIES
from survey_mc.telescope import INSTRUMENTS, InstrumentSettings

_INTRODUCTION = """# Campaign files

A campaign is one TOML file: what is up there, which instrument looks at it, for how long, which procedures search the
images, and how detections are identified with true sources. `survey-mc validate FILE` checks one and prints what it
expands to; `survey-mc show schema` gives the same rules as JSON Schema for editors.

Keys say their unit. A number may also be a text with a unit of the same kind (`exposure_ks = ["10 ks", "2.8 h"]`).
Unknown keys are refused, and the nearest known one is named. Nothing in a campaign is executed or followed, except
the paths of sky images and of networks (`.nnw`), which must lie below the campaign's own folder.

| file | what it does |
|---|---|
| `smoke.toml` | a few fields through all procedures; half a minute on two cores, and as long again to compile once |
| `blank_fields.toml` | what each procedure finds where there is nothing |
| `test1_point_pairs.toml` | pairs of point sources at 15, 30 and 60″ (paper, Sect. 4) |
| `test2_point_extended_pairs.toml` | point sources beside clusters (paper, Sect. 5) |
| `test3_field_points.toml` | a shallow field of point sources (paper, Sect. 6) |
| `test4_field_clusters.toml` | the same points and five clusters (paper, Sect. 7) |
| `test5_completeness.toml` | completeness and confusion of a shallow and a deep observation (paper, Sect. 8) |
| `test5_isolated_grid.toml` | the same fluxes without neighbours (paper, Sect. 8) |
| `options/*.toml` | one of these with one choice changed; `survey-mc paper` measures what it does |
| `classification_training.toml` | points and clusters to train the stellarity index (`survey-mc train-stellarity`) |

This page is written by `python -m survey_mc.campaign.reference`.
"""


def reference() -> str:
    """The whole reference as Markdown."""
    parts = [_INTRODUCTION, *_section("Top level", Campaign, "")]
    parts += _section("[instrument]", InstrumentSettings, f"Registered: {', '.join(INSTRUMENTS.names)}.")
    for sky in SKIES:
        parts += _section(f'[sky] with kind = "{sky.name}"', sky.params, _sentence(sky.about))
    parts.append("## Relations for `model` of lognlogs\n\n" + "\n".join(f"- `{r.name}`: {r.about}" for r in RELATIONS))
    parts += _section("[grid]", Grid, "")
    parts += _section("[[method]]", MethodChoice, "")
    for detector in DETECTORS.built_in:  # the page is the same wherever it is written
        about = f"{_sentence(detector.about)} {_sentence(detector.reference)} Profiles: {', '.join(detector.profiles)}."
        parts += _section(f'params of method "{detector.name}" ({detector.label})', detector.params, about)
    parts += _section("[match]", MatchParams, "")
    parts += _section("[store]", StoreSettings, "")
    return "\n\n".join(part.rstrip() for part in parts) + "\n"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")


def _section(title: str, model: type[BaseModel], about: str) -> Iterator[str]:
    yield f"## {title}"
    if about:
        yield about
    rows = ["| key | default | meaning |", "|---|---|---|"]
    for name, info in model.model_fields.items():
        if name == "kind":
            continue  # it is the title
        rows.append(f"| `{info.alias or name}` | {_default(info)} | {(info.description or '').replace('|', '/')} |")
    yield "\n".join(rows)


def _default(info: Any) -> str:
    if info.is_required():
        return "required"
    value = info.get_default(call_default_factory=True)
    if isinstance(value, BaseModel):
        return "see its table"
    if value is None:
        return "–"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        return f"`{list(value)}`"
    return f"`{value!r}`".replace("'", '"')


if __name__ == "__main__":
    print(reference(), end="")
