"""What a campaign file may say.

Idea     data, not code: typed, frozen, unknown keys refused, no expressions, includes or environment variables. Every
         field has a description; help texts and the JSON Schema are made from them.
Limits   the limits on sizes are there to refuse slips of the keyboard before they cost a night, not to save memory.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    SerializeAsAny,
    field_validator,
    model_validator,
)

from survey_mc.detect import DETECTORS
from survey_mc.detect.detector import DetectorParams
from survey_mc.match import MatchParams
from survey_mc.registry import UnknownName
from survey_mc.sky import AnySkyParams
from survey_mc.telescope import InstrumentSettings
from survey_mc.types import BandName

MAX_EXPOSURE_KS = 5000.0
MAX_REALISATIONS = 10_000_000
MAX_CELLS = 1000
MAX_METHODS = 100
MAX_PAIRS = 10_000  # of a cell and a method: each has keys, a row in every table and a line in the lock file
MAX_FIELDS = 10_000_000
MAX_FILES = 1_000_000
NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_.\-]{0,99}$"
ONE_LINE_PATTERN = r"^[^\x00-\x1f\x7f-\x9f]*$"


def _as_tuple(value: Any) -> Any:
    """One value stands for a list of one."""
    if isinstance(value, list):
        return tuple(value)
    return (value,) if isinstance(value, str | int | float) and not isinstance(value, bool) else value


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)


Exposure = Annotated[float, Field(gt=0, le=MAX_EXPOSURE_KS)]


class Grid(_Strict):
    """The combinations to simulate: every band with every exposure, each with the same number of realisations."""

    band: Annotated[tuple[BandName, ...], BeforeValidator(_as_tuple)] = Field(
        ("soft",), min_length=1, description="energy bands: soft (0.5-2 keV), hard (2-10 keV)"
    )
    exposure_ks: Annotated[tuple[Exposure, ...], BeforeValidator(_as_tuple)] = Field(
        min_length=1, max_length=MAX_CELLS, description="exposure times, ks"
    )
    realisations: int = Field(strict=True, ge=1, le=MAX_REALISATIONS, description="random realisations of each cell")

    @model_validator(mode="after")
    def _no_repeats(self) -> Grid:
        for name in ("band", "exposure_ks"):
            values = getattr(self, name)
            if len(set(values)) != len(values):
                raise ValueError(f"{name} must not repeat a value (got {list(values)})")
        if len({f"{exposure_ks:g}" for exposure_ks in self.exposure_ks}) < len(self.exposure_ks):
            raise ValueError(f"exposure_ks must differ in their first six digits (got {list(self.exposure_ks)})")
        return self


class MethodChoice(_Strict):
    """One detection procedure of the campaign, with its own parameters."""

    name: str = Field(description="registered procedure, see `survey-mc show methods`")
    label: str = Field(
        "",
        max_length=80,
        pattern=ONE_LINE_PATTERN,
        description="name in tables and figures; default: the procedure's own",
    )
    profile: str = Field("paper", description="named set of parameters to start from")
    params: SerializeAsAny[DetectorParams] = Field(
        DetectorParams(), validate_default=True, description="parameters that differ from the profile"
    )

    @field_validator("name")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in DETECTORS:
            raise ValueError(str(DETECTORS.why_not(name, "method")))
        return name

    @field_validator("profile")
    @classmethod
    def _known_profile(cls, profile: str, info: Any) -> str:
        if "name" in info.data:
            known = DETECTORS[info.data["name"]].profiles
            if profile not in known:
                raise ValueError(str(UnknownName(f"profile of {info.data['name']}", profile, known)))
        return profile

    @field_validator("params", mode="wrap")
    @classmethod
    def _of_the_method(cls, value: Any, handler: Any, info: Any) -> DetectorParams:
        if "name" not in info.data or "profile" not in info.data:
            return DetectorParams()
        detector = DETECTORS[info.data["name"]]
        profile = detector.profiles[info.data["profile"]]
        given = value.model_dump(exclude_unset=True) if isinstance(value, DetectorParams) else value
        if not isinstance(given, dict):
            raise ValueError("params must be a table of parameters")
        return detector.params.model_validate_json(
            json.dumps({**profile.model_dump(mode="json"), **given}), strict=True
        )

    @model_validator(mode="after")
    def _default_label(self) -> MethodChoice:
        return self if self.label else self.model_copy(update={"label": DETECTORS[self.name].label})


class StoreSettings(_Strict):
    """How results are cut into files."""

    realisations_per_file: int = Field(
        64,
        strict=True,
        ge=1,
        le=10_000,
        description="realisations in one stored file; does not depend on how they are scheduled",
    )


class Campaign(_Strict):
    """A whole campaign: one instrument, one sky recipe, a grid of bands and exposures, methods and a matching rule."""

    schema_version: Literal[1] = Field(alias="schema", description="version of this file format: 1")
    name: str = Field(pattern=NAME_PATTERN, description="letters, digits, _ - and . only; results go to results/<name>")
    seed: int = Field(strict=True, ge=0, lt=2**63, description="every random number of the campaign follows from it")
    about: str = Field("", max_length=2000, pattern=ONE_LINE_PATTERN, description="one sentence for the report")
    instrument: InstrumentSettings = Field(description="telescope and camera, effects that are on, numbers that differ")
    sky: AnySkyParams = Field(description="what is up there")
    grid: Grid = Field(description="bands, exposures, realisations")
    method: tuple[MethodChoice, ...] = Field(
        min_length=1, max_length=MAX_METHODS, description="detection procedures to compare"
    )
    match: MatchParams = Field(
        default_factory=MatchParams, description="how detections are identified with true sources"
    )
    store: StoreSettings = Field(default_factory=StoreSettings, description="how results are cut into files")

    # Its text, where it was read, and the SHA-256 of the files it names there; set once by the loader.
    _text: str = PrivateAttr(default="")
    _folder: Path = PrivateAttr(default_factory=Path)
    _input_digests: dict[str, str] = PrivateAttr(default_factory=dict)

    @property
    def text(self) -> str:
        """The TOML text it was loaded from, verbatim."""
        return self._text

    @property
    def folder(self) -> Path:
        """Folder that the campaign's paths are relative to."""
        return self._folder

    @property
    def input_digests(self) -> dict[str, str]:
        """SHA-256 of each file the campaign names (sky images, networks), by its path in the campaign."""
        return self._input_digests

    @model_validator(mode="after")
    def _whole(self) -> Campaign:
        labels = [m.label for m in self.method]
        repeated = sorted({label for label in labels if labels.count(label) > 1})
        if repeated:
            raise ValueError(f"method: two methods are labelled {repeated[0]!r}; give each a `label` of its own")
        n_cells = len(self.grid.band) * len(self.grid.exposure_ks)
        if n_cells > MAX_CELLS:
            raise ValueError(f"grid: has {n_cells} cells; at most {MAX_CELLS} are allowed")
        if n_cells * len(self.method) > MAX_PAIRS:
            raise ValueError(
                f"grid: has {n_cells * len(self.method)} pairs of a cell and a method; at most {MAX_PAIRS} are allowed"
            )
        n_fields = n_cells * self.grid.realisations
        if n_fields > MAX_FIELDS:
            raise ValueError(f"grid: has {n_fields} fields (cells × realisations); at most {MAX_FIELDS} are allowed")
        n_files = n_cells * -(-self.grid.realisations // self.store.realisations_per_file) * (1 + 3 * len(self.method))
        if n_files > MAX_FILES:
            raise ValueError(
                f"grid: the results would be {n_files} files; at most {MAX_FILES} are allowed: a larger "
                f"store.realisations_per_file (got {self.store.realisations_per_file})"
            )
        for exposure_ks in self.grid.exposure_ks:
            try:
                self.match.limit(exposure_ks)
            except ValueError as problem:
                raise ValueError(f"match.{problem}") from None
        return self


def json_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of a campaign file, with the parameters of every registered method."""
    schema = Campaign.model_json_schema(by_alias=True)
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "survey_mc campaign"
    definitions = schema.setdefault("$defs", {})
    branches = []
    for detector in DETECTORS:
        params = detector.params.model_json_schema()
        definitions.update(params.pop("$defs", {}))
        definitions[f"params_{detector.name}"] = params
        branches.append(
            {
                "if": {"properties": {"name": {"const": detector.name}}},
                "then": {"properties": {"params": {"$ref": f"#/$defs/params_{detector.name}"}}},
            }
        )
    choice = definitions["MethodChoice"]
    choice["properties"]["params"] = {"type": "object"}
    choice["properties"]["name"]["enum"] = list(DETECTORS.names)
    choice["allOf"] = branches
    return schema
