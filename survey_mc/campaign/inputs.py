"""The files a campaign names, sky images and those of a method's parameters: found, checked, part of the content keys.

Idea     a path in a campaign is relative to the campaign file and stays inside its folder; the SHA-256 of the file
         enters the key, so an edited file recomputes what depends on it and a renamed folder nothing.
Limits   a file larger than the largest image that is read is refused before it is hashed.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

from survey_mc.caches import bounded_cache
from survey_mc.campaign.schema import Campaign
from survey_mc.detect import DetectorParams
from survey_mc.errors import BadInput
from survey_mc.files import open_regular
from survey_mc.fits import read_sky_image
from survey_mc.fits.container import MAX_PIXELS
from survey_mc.sky import AnySkyParams
from survey_mc.sky.combined import CombinedParams
from survey_mc.sky.image import ImageParams
from survey_mc.types import SkyImage

SKY_IMAGE = "sky image"
MAX_INPUT_BYTES = 2**29 + 2**20  # 8192² pixels of double precision, and headers
MAX_SHOWN = 80  # characters of a path in an error sentence


def resolve_input(path: str, folder: Path, where: str, noun: str = "file") -> Path:
    """The file a campaign's path means; refuses absolute paths, `..`, `~` and links that leave the folder.

    noun: what the file is, for the sentence of the error.
    """
    pure, shown = PurePosixPath(path), repr(path[:MAX_SHOWN])
    if not path or "\0" in path or pure.is_absolute() or ".." in pure.parts or path.startswith("~") or ":" in path:
        raise BadInput(where, f"{noun} path must be relative and stay below the campaign's folder (got {shown})")
    try:
        root, file = folder.resolve(), (folder / pure).resolve()
        inside, there, regular = file.is_relative_to(root), file.exists(), file.is_file()
    except (OSError, RuntimeError) as problem:  # until Python 3.12 a loop of links is a RuntimeError
        cause = getattr(problem, "strerror", None) or "a loop of links"
        raise BadInput(where, f"{noun} {shown} cannot be followed to a file ({cause})") from None
    if not inside:
        raise BadInput(where, f"{noun} {shown} leaves the campaign's folder through a link")
    if not there:
        raise BadInput(where, f"{noun} {shown} does not exist in {root}")
    if not regular:
        raise BadInput(where, f"{noun} {shown} is not a regular file")
    return file


def input_digests(campaign: Campaign, folder: Path, where: str) -> dict[str, str]:
    """SHA-256 of each file the campaign names, by its path in the campaign."""
    nouns = dict.fromkeys(sky_image_paths(campaign.sky), SKY_IMAGE)
    for number, choice in enumerate(campaign.method):
        for name, path in choice.params.input_files().items():
            nouns.setdefault(path, f"method[{number}].params.{name}: file")
    return {path: _digest(resolve_input(path, folder, where, noun), where, noun) for path, noun in nouns.items()}


def sky_image_paths(sky: AnySkyParams) -> tuple[str, ...]:
    """The images a sky recipe names."""
    return tuple(params.path for params in _image_params(sky))


def sky_images(campaign: Campaign) -> Mapping[str, SkyImage]:
    """The images of a loaded campaign, read once per process."""
    digests = campaign.input_digests
    images: dict[str, SkyImage] = {}
    for params in _image_params(campaign.sky):
        file = resolve_input(params.path, campaign.folder, "campaign", SKY_IMAGE)
        images[params.path] = _read_image(str(file), digests[params.path], params.scale_arcsec)
        n_pixels = sum(image.rate_cps.size for image in images.values())
        if n_pixels > MAX_PIXELS:
            raise BadInput("sky", f"its images have {n_pixels} pixels together; at most {MAX_PIXELS} are allowed")
    return images


def located_params(campaign: Campaign, params: DetectorParams) -> DetectorParams:
    """Parameters of a method of a loaded campaign whose files are where `detect` finds them; `BadInput` if a file is
    not what it was when the campaign was loaded."""
    found: dict[str, str] = {}
    for name, path in params.input_files().items():
        file = resolve_input(path, campaign.folder, "campaign")
        _refuse_changed(str(file), _digest(file), campaign.input_digests[path])
        found[name] = str(file)
    return params.model_copy(update=found) if found else params


def _image_params(sky: AnySkyParams) -> Iterator[ImageParams]:
    for part in sky.parts if isinstance(sky, CombinedParams) else (sky,):
        if isinstance(part, ImageParams):
            yield part


def _digest(file: Path, where: str = "campaign", noun: str = "file") -> str:
    try:
        with open_regular(file) as handle:
            size = os.fstat(handle.fileno()).st_size
            if size > MAX_INPUT_BYTES:
                problem = f"must be at most {MAX_INPUT_BYTES} bytes long (got {size})"
                raise BadInput(where, f"{noun} {file.name[:MAX_SHOWN]!r} {problem}")
            return hashlib.file_digest(handle, "sha256").hexdigest()
    except OSError as problem:
        raise BadInput(where, f"{noun} {file.name[:MAX_SHOWN]!r} cannot be read ({problem.strerror})") from None


def _refuse_changed(path: str, digest: str, expected: str) -> None:
    if digest != expected:
        raise BadInput(path, "has changed since the campaign was loaded; load the campaign again")


@bounded_cache(8)
def _read_image(path: str, digest: str, scale_arcsec: float) -> SkyImage:
    _refuse_changed(path, _digest(Path(path)), digest)
    # What the pixels hold (rate or flux) is the recipe's word; only the numbers are read here.
    return read_sky_image(path, pixel_scale_arcsec=scale_arcsec, unit="ct/s")
