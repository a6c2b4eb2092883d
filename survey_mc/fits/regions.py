"""DS9 region files: detections to look at on the image.

Idea     one circle or ellipse a detection, labelled with its number; sky coordinates when the image has a WCS, FITS
         pixels (first centre at 1) otherwise.
Source   DS9 reference manual, "Regions": angles are in degrees, counter-clockwise from the x axis, and for a north-up
         image x points west, so a sky ellipse is drawn at its position angle + 90.
Limits   the reader understands circles and ellipses in image, fk5 or icrs coordinates, for checks and source lists.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from survey_mc.errors import BadInput
from survey_mc.files import read_regular
from survey_mc.fits.container import quiet
from survey_mc.fits.wcs import fits_from_pix, icrs_deg
from survey_mc.fits.writing import ascii_text, check_target, creator, write_whole
from survey_mc.types import FloatArray, Observation
from survey_mc.units import ARCSEC_PER_DEG

if TYPE_CHECKING:
    from astropy.wcs import WCS
    from pandas import DataFrame

COLOURS = ("black", "white", "red", "green", "blue", "cyan", "magenta", "yellow")
SHAPE_COLUMNS = ("a_pix", "b_pix", "theta_deg")
KRON_COLUMN = "kron_radius"  # in units of the semi-axes (Kron 1980; Bertin & Arnouts 1996)
MAX_BYTES = 2**24  # 16 MiB, some 200 000 regions
_SHAPE = re.compile(r"(?:(image|fk5|icrs)\s*;\s*)?(circle|ellipse)\s*\(([^()]*)\)\s*(?:#\s*(.*))?", re.IGNORECASE)
_NUMBER_ARGUMENTS = {"circle": 3, "ellipse": 5}


@dataclass(frozen=True, slots=True)
class Region:
    """A circle or an ellipse. frame: image (FITS pixels), fk5 or icrs (deg, sizes in arcsec); angle_deg as in DS9."""

    shape: str
    frame: str
    x: float
    y: float
    semi_major: float
    semi_minor: float
    angle_deg: float
    colour: str
    label: str


@quiet()
def write_regions(
    path: str | Path,
    detections: DataFrame,
    observation: Observation,
    *,
    colour: str = "green",
    title: str = "",
    overwrite: bool = False,
) -> None:
    """One region a detection: its ellipse if the frame has `SHAPE_COLUMNS` (semi-axes in pixels, angle from +x
    counter-clockwise; times `KRON_COLUMN` if there), else a circle of radius max(r50_arcsec, half of the believed
    half-energy width).

    colour: one of `COLOURS` or #rrggbb. title: a comment line. Raises `BadInput`.
    """
    check_target(path, overwrite)
    if colour not in COLOURS and not re.fullmatch(r"#[0-9a-fA-F]{6}", colour):
        raise BadInput("colour", f"must be one of {', '.join(COLOURS)} or #rrggbb (got {colour!r})")
    wcs, scale_arcsec = observation.grid.wcs, observation.grid.scale_arcsec
    x_pix, y_pix = detections["x_pix"].to_numpy(), detections["y_pix"].to_numpy()
    semi_arcsec = _semi_axes_arcsec(detections, observation)
    angles_deg = np.zeros(len(detections))
    if SHAPE_COLUMNS[2] in detections:
        angles_deg = np.asarray(detections[SHAPE_COLUMNS[2]].to_numpy(), dtype=np.float64)
    if wcs is None:
        frame, unit, sizes = "image", "", semi_arcsec / scale_arcsec
        x, y = fits_from_pix(x_pix), fits_from_pix(y_pix)
    else:
        frame, unit, sizes = "icrs", '"', semi_arcsec
        x, y = icrs_deg(wcs, x_pix, y_pix)
        angles_deg = _sky_angles_deg(wcs, x_pix, y_pix, angles_deg)
    lines = ["# Region file format: DS9 version 4.1", f"# {ascii_text(title)} ({creator()})"]
    lines += [f"global color={colour}", frame]
    digits = 3 if wcs is None else 7
    for row, det_id in enumerate(detections["det_id"]):
        place = f"{x[row]:.{digits}f},{y[row]:.{digits}f}"
        major, minor = (f"{size:.3f}{unit}" for size in sizes[row])
        if sizes[row, 0] == sizes[row, 1]:
            lines.append(f"circle({place},{major}) # text={{{det_id}}}")
        else:
            lines.append(f"ellipse({place},{major},{minor},{angles_deg[row] % 360.0:.2f}) # text={{{det_id}}}")
    write_whole(path, ("\n".join(lines) + "\n").encode("ascii"), overwrite)


def _semi_axes_arcsec(detections: DataFrame, observation: Observation) -> FloatArray:
    """(n, 2) semi-axes; the circle where the procedure measured no usable shape."""
    half_light = detections["r50_arcsec"].to_numpy(dtype=np.float64)
    radius = np.fmax(half_light, observation.psf.hew_arcsec / 2.0)
    circles = np.column_stack([radius, radius])
    if not all(name in detections for name in SHAPE_COLUMNS):
        return circles
    axes_pix = detections[list(SHAPE_COLUMNS[:2])].to_numpy(dtype=np.float64)
    if KRON_COLUMN in detections:
        axes_pix = axes_pix * detections[KRON_COLUMN].to_numpy(dtype=np.float64)[:, None]
    usable = np.all(np.isfinite(axes_pix) & (axes_pix > 0.0), axis=1) & np.isfinite(detections[SHAPE_COLUMNS[2]])
    return np.where(usable.to_numpy()[:, None], axes_pix * observation.grid.scale_arcsec, circles)


def _sky_angles_deg(wcs: WCS, x_pix: FloatArray, y_pix: FloatArray, theta_deg: FloatArray) -> FloatArray:
    """DS9 angle on the sky of a direction in the image: position angle (north through east) + 90."""
    theta = np.radians(theta_deg)
    ra_0, dec_0 = icrs_deg(wcs, x_pix, y_pix)
    ra_1, dec_1 = icrs_deg(wcs, x_pix + np.cos(theta), y_pix + np.sin(theta))
    east = np.radians((ra_1 - ra_0 + 180.0) % 360.0 - 180.0) * np.cos(np.radians(dec_0))
    return np.asarray(np.degrees(np.arctan2(east, np.radians(dec_1 - dec_0))) + 90.0, dtype=np.float64)


def read_regions(path: str | Path) -> list[Region]:
    """Circles and ellipses of a DS9 region file, in file order; other shapes raise `BadInput` with their line."""
    try:
        content = read_regular(path, MAX_BYTES)
    except OSError as error:
        raise BadInput(str(path), f"cannot be read ({error.strerror or error})") from error
    frame, colour = "image", "green"
    regions: list[Region] = []
    for number, raw in enumerate(content.decode("utf-8", "replace").splitlines(), start=1):
        line = raw.strip()
        if line.startswith("global"):
            colour = _property(line, "color") or colour
        elif line.casefold() in ("image", "fk5", "icrs"):
            frame = line.casefold()
        elif line and not line.startswith("#"):
            regions.append(_region(line, frame, colour, f"{path}: line {number}"))
    return regions


def _region(line: str, frame: str, colour: str, where: str) -> Region:
    match = _SHAPE.fullmatch(line)
    if match is None:
        raise BadInput(where, f"must be a circle or an ellipse in image, fk5 or icrs coordinates (got {line[:60]!r})")
    shape, own_frame = match[2].casefold(), (match[1] or frame).casefold()
    arguments = [argument.strip() for argument in match[3].split(",")]
    if len(arguments) != _NUMBER_ARGUMENTS[shape]:
        raise BadInput(where, f"a {shape} has {_NUMBER_ARGUMENTS[shape]} numbers (got {len(arguments)})")
    sizes = arguments[2:4] if shape == "ellipse" else [arguments[2]] * 2
    try:
        x, y = float(arguments[0]), float(arguments[1])
        major, minor = (_size(size, own_frame) for size in sizes)
        angle_deg = float(arguments[4]) if shape == "ellipse" else 0.0
    except ValueError:
        raise BadInput(where, f"its numbers cannot be read (got {match[3]!r}); sexagesimal is not understood") from None
    notes = match[4] or ""
    label = re.search(r"text=\{([^}]*)\}", notes)
    return Region(
        shape, own_frame, x, y, major, minor, angle_deg, _property(notes, "color") or colour, label[1] if label else ""
    )


def _size(argument: str, frame: str) -> float:
    """Pixels in image coordinates, arcsec on the sky (where a bare number is in degrees)."""
    if frame == "image":
        return float(argument)
    factors = {'"': 1.0, "'": 60.0, "d": ARCSEC_PER_DEG}
    factor = factors.get(argument[-1:])
    return float(argument) * ARCSEC_PER_DEG if factor is None else float(argument[:-1]) * factor


def _property(notes: str, name: str) -> str:
    match = re.search(rf"{name}\s*=\s*([#\w]+)", notes)
    return match[1] if match else ""
