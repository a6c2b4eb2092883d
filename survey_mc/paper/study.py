"""The campaigns that make up the reproduction of Valtchanov, Pierre & Gastaud 2001, and how large each of them is.

Idea     two numbers size the whole study: `images` for what the paper shows of one image (Tests 1, 2 and 4), and
         `realisations` where it averages ten. Base campaigns are the paper's tests; option campaigns repeat one of them
         with one named choice changed, on the same fields where the sky allows, to measure what the choice does.
Source   paper Sects. 4 to 8.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from survey_mc.errors import BadInput

PAPER_REALISATIONS = 10
PAPER_IMAGES = 1
IMAGES_PER_REALISATION = 4  # when only `realisations` is given, and it is more than the paper's
LEAST_FIELDS = 39  # for a verdict: 1 / (39 + 1) is 2.5 %
OPTION_FIELDS = 50  # options measure shifts of medians, and 39 are the least
MAX_REALISATIONS = 100_000

Scale = Literal["images", "realisations"]


@dataclass(frozen=True, slots=True)
class StudyCampaign:
    """One campaign of the study. scale: which of the two numbers it has; base: the campaign an option repeats."""

    name: str
    scale: Scale
    base: str = ""

    @property
    def is_option(self) -> bool:
        return bool(self.base)

    def file(self, folder: Path) -> Path:
        """Its campaign file below the folder of campaigns."""
        return folder / ("options" if self.is_option else "") / f"{self.name}.toml"


TEST_1, TEST_2, TEST_3, TEST_4, TEST_5, GRID, BLANK = (
    "test1_point_pairs",
    "test2_point_extended_pairs",
    "test3_field_points",
    "test4_field_clusters",
    "test5_completeness",
    "test5_isolated_grid",
    "blank_fields",
)

BASE = (
    StudyCampaign(TEST_1, "images"),
    StudyCampaign(TEST_2, "images"),
    StudyCampaign(TEST_3, "realisations"),
    StudyCampaign(TEST_4, "images"),
    StudyCampaign(TEST_5, "realisations"),
    StudyCampaign(GRID, "realisations"),
    StudyCampaign(BLANK, "realisations"),
)

OPTIONS = (
    StudyCampaign("test1_options", "images", TEST_1),
    StudyCampaign("test1_whole_image", "images", TEST_1),
    StudyCampaign("test1_fainter_pairs", "images", TEST_1),
    StudyCampaign("test1_wide_radius", "images", TEST_1),
    StudyCampaign("test1_believed_psf", "images", TEST_1),
    StudyCampaign("test2_options", "images", TEST_2),
    StudyCampaign("test2_whole_image", "images", TEST_2),
    StudyCampaign("test2_text_core_radius", "images", TEST_2),
    StudyCampaign("test3_options", "realisations", TEST_3),
    StudyCampaign("test3_believed_psf", "realisations", TEST_3),
    StudyCampaign("test3_giacconi2001", "realisations", TEST_3),
    StudyCampaign("test3_full_square", "realisations", TEST_3),
    StudyCampaign("test3_giacconi2001_full_square", "realisations", TEST_3),
    StudyCampaign("test4_options", "images", TEST_4),
    StudyCampaign("test4_text_core_radius", "images", TEST_4),
    StudyCampaign("test4_no_vignetting", "images", TEST_4),
    StudyCampaign("test5_options", "realisations", TEST_5),
    StudyCampaign("test5_giacconi2001", "realisations", TEST_5),
    StudyCampaign("test5_giacconi2001_full_square", "realisations", TEST_5),
    StudyCampaign("test5_expected_counts", "realisations", TEST_5),
)


@dataclass(frozen=True, slots=True)
class StudySize:
    """How many fields the campaigns have. realisations: where the paper has ten; images: where it has one."""

    realisations: int = PAPER_REALISATIONS
    images: int = PAPER_IMAGES

    def __post_init__(self) -> None:
        for name in ("realisations", "images"):
            if not 1 <= getattr(self, name) <= MAX_REALISATIONS:
                raise BadInput("paper", f"--{name} must be 1..{MAX_REALISATIONS} (got {getattr(self, name)})")

    @classmethod
    def of(cls, realisations: int | None, images: int | None) -> StudySize:
        """The size somebody asks for; without a word it is the paper's own."""
        n = PAPER_REALISATIONS if realisations is None else realisations
        if images is None:
            images = min(IMAGES_PER_REALISATION * n, MAX_REALISATIONS) if n > PAPER_REALISATIONS else PAPER_IMAGES
        return cls(n, images)

    @property
    def decides(self) -> bool:
        """Whether there are enough fields for verdicts on what is drawn; without those an option explains nothing."""
        return min(self.realisations, self.images) >= LEAST_FIELDS

    def fields(self, campaign: StudyCampaign) -> int:
        """Realisations of each cell of a campaign; the first ones of its base for an option."""
        wanted = self.images if campaign.scale == "images" else self.realisations
        return min(wanted, OPTION_FIELDS) if campaign.is_option else wanted


def study_campaigns(with_options: bool = True) -> Iterator[StudyCampaign]:
    """The campaigns in the order in which they are run."""
    yield from BASE
    if with_options:
        yield from OPTIONS
