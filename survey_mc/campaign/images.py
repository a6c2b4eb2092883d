"""The sky images a campaign names: found, checked, and part of the content keys by what they contain.

Idea     a path in a campaign is relative to the campaign file and stays inside its folder; the SHA-256 of the file
         enters the key, so an edited image recomputes what depends on it and a renamed folder nothing.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path, PurePosixPath

from survey_mc.campaign.schema import Campaign
from survey_mc.errors import BadInput
from survey_mc.fits import read_sky_image
from survey_mc.sky import AnySkyParams
from survey_mc.sky.combined import CombinedParams
from survey_mc.sky.image import ImageParams
from survey_mc.types import SkyImage


def resolve_image(path: str, folder: Path, where: str) -> Path:
    """The file a campaign's image path means; refuses absolute paths, `..`, `~` and links that leave the folder."""
    pure = PurePosixPath(path)
    if not path or "\0" in path or pure.is_absolute() or ".." in pure.parts or path.startswith("~") or ":" in path:
        raise BadInput(
            where, f"sky image path must be relative and stay below the campaign's folder (got {path[:80]!r})"
        )
    try:
        root, file = folder.resolve(), (folder / pure).resolve()
    except (OSError, RuntimeError):  # until Python 3.12 a loop of links is a RuntimeError
        raise BadInput(where, f"sky image {path[:80]!r} cannot be followed to a file") from None
    if not file.is_relative_to(root):
        raise BadInput(where, f"sky image {path[:80]!r} leaves the campaign's folder through a link")
    if not file.is_file():
        raise BadInput(where, f"sky image {path[:80]!r} does not exist in {root}")
    return file


def image_digests(sky: AnySkyParams, folder: Path, where: str) -> dict[str, str]:
    """SHA-256 of each image the sky recipe names, by its path in the campaign."""
    found: dict[str, str] = {}
    for params in _image_params(sky):
        path = params.path
        with resolve_image(path, folder, where).open("rb") as handle:
            found[path] = hashlib.file_digest(handle, "sha256").hexdigest()
    return found


def sky_images(campaign: Campaign) -> Mapping[str, SkyImage]:
    """The images of a loaded campaign, read once per process."""
    digests = campaign.image_digests
    return {
        params.path: _read(
            str(resolve_image(params.path, campaign.folder, "campaign")), digests[params.path], params.scale_arcsec
        )
        for params in _image_params(campaign.sky)
    }


def _image_params(sky: AnySkyParams) -> Iterator[ImageParams]:
    for part in sky.parts if isinstance(sky, CombinedParams) else (sky,):
        if isinstance(part, ImageParams):
            yield part


@lru_cache(maxsize=8)
def _read(path: str, digest: str, scale_arcsec: float) -> SkyImage:
    with open(path, "rb") as handle:
        if hashlib.file_digest(handle, "sha256").hexdigest() != digest:
            raise BadInput(path, "has changed since the campaign was loaded; load the campaign again")
    # What the pixels hold (rate or flux) is the recipe's word; only the numbers are read here.
    return read_sky_image(path, pixel_scale_arcsec=scale_arcsec, unit="ct/s")
