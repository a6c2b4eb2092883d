"""The cells of a campaign and the content keys of what will be computed in each.

Idea     a cell is one combination of the grid. All cells of a campaign share the random streams of the sky, so
         exposures and bands of one realisation look at the same sources; photons are drawn anew in each cell.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from survey_mc.campaign.inputs import sky_image_paths
from survey_mc.campaign.keys import FIELD_VERSION, SKY_VERSION, content_key
from survey_mc.campaign.schema import Campaign
from survey_mc.detect import DETECTORS
from survey_mc.match import MATCH_VERSION
from survey_mc.telescope import INSTRUMENTS
from survey_mc.types import BandName
from survey_mc.units import SECONDS_PER_KS

# What only the observer believes, or where the telescope points: no photon depends on it.
OBSERVER_SETTINGS = ("believed_psf", "grants_background")
LABEL_SETTINGS = ("pointing_deg",)


@dataclass(frozen=True, slots=True)
class CellMethod:
    """A method in a cell with the keys of its detections and matches."""

    label: str
    name: str
    detect_key: str
    match_key: str


@dataclass(frozen=True, slots=True)
class Cell:
    """One combination of the grid. counts_min: count limit of the input list. index: place in the campaign, from 0."""

    index: int
    label: str
    instrument: str
    band: BandName
    exposure_ks: float
    realisations: int
    counts_min: float
    sky_stream_key: str
    field_key: str
    methods: tuple[CellMethod, ...]

    @property
    def exposure_s(self) -> float:
        return self.exposure_ks * SECONDS_PER_KS


def expand(campaign: Campaign) -> tuple[Cell, ...]:
    """The cells of a campaign, exposures within bands, with the keys of all their results."""
    combinations = ((band, exposure) for band in campaign.grid.band for exposure in campaign.grid.exposure_ks)
    return tuple(_cell(campaign, index, band, exposure) for index, (band, exposure) in enumerate(combinations))


def _cell(campaign: Campaign, index: int, band: BandName, exposure_ks: float) -> Cell:
    settings = campaign.instrument.model_dump(mode="json")
    observer = {name: settings.pop(name) for name in OBSERVER_SETTINGS}
    for name in LABEL_SETTINGS:
        settings.pop(name)
    # The streams hang on the seed alone: a deeper flux limit or an added cluster moves no other source.
    sky_stream_key = content_key("sky", seed=campaign.seed)
    sky_key = content_key(
        sky_stream_key,
        sky=_of_band(campaign.sky.model_dump(mode="json"), band),
        images={path: campaign.input_digests[path] for path in sky_image_paths(campaign.sky)},
        version=SKY_VERSION,
    )
    field_key = content_key(
        sky_key,
        instrument=_of_band(settings, band),
        numbers=_of_band(asdict(INSTRUMENTS[campaign.instrument.name]), band),
        band=band,
        exposure_ks=exposure_ks,
        version=FIELD_VERSION,
    )
    return Cell(
        index=index,
        label=f"{campaign.instrument.name}-{band}-{exposure_ks:g}ks",
        instrument=campaign.instrument.name,
        band=band,
        exposure_ks=exposure_ks,
        realisations=campaign.grid.realisations,
        counts_min=campaign.match.limit(exposure_ks),
        sky_stream_key=sky_stream_key,
        field_key=field_key,
        methods=tuple(_methods(campaign, field_key, observer, campaign.match.limit(exposure_ks))),
    )


def _methods(campaign: Campaign, field_key: str, observer: dict[str, Any], counts_min: float) -> Iterator[CellMethod]:
    # The rule a table shows and the limits of other exposures change no match: both rules are always stored.
    matching = campaign.match.model_dump(mode="json", exclude={"rule", "counts_min"})
    for choice in campaign.method:
        contents = {name: campaign.input_digests[path] for name, path in choice.params.input_files().items()}
        detect_key = content_key(
            field_key,
            method=choice.name,
            version=DETECTORS[choice.name].version,
            params=choice.params.model_dump(mode="json") | contents,
            observer=observer,
        )
        match_key = content_key(detect_key, match=matching, counts_min=counts_min, version=MATCH_VERSION)
        yield CellMethod(choice.label, choice.name, detect_key, match_key)


def _of_band(value: Any, band: str) -> Any:
    """The same content with every per-band table reduced to the band: another band's numbers do not matter here."""
    if isinstance(value, dict):
        if value and set(value) <= {"soft", "hard"}:
            return _of_band(value.get(band), band)
        return {key: _of_band(part, band) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_of_band(part, band) for part in value]
    return value
