"""Counts images.

Idea     one sentence for every image that cannot be a photon-counting one; nothing is repaired or guessed.
Source   FITS standard 4.0; conventions of XMM-Newton, Chandra and eROSITA images.
Limits   photons must be whole: exposure-corrected, smoothed or background-subtracted images have lost their Poisson
         statistics and are refused. Images with out-of-time events subtracted are made whole again (`out_of_time`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from survey_mc.errors import BadInput
from survey_mc.fits.container import Hdu, quiet, read_hdu
from survey_mc.fits.header import ImageFacts, image_facts, number
from survey_mc.fits.out_of_time import restore_whole_counts
from survey_mc.fits.wcs import MAX_ANISOTROPY, celestial_wcs, pix_of_pointing, pixel_scale_arcsec
from survey_mc.types import BoolArray, FloatImage, IntImage, PixelGrid

MAX_FRACTION = 1e-6  # how far from a whole number a stored photon number may be
MAX_COUNTS = 2**31 - 1
SCALE_RANGE_ARCSEC = (1e-3, 3600.0)  # of a pixel; X-ray images have 0.1″ to some arcmin
PIECE_PIXELS = 2**20
_DTYPES = {8: "u1", 16: ">i2", 32: ">i4", 64: ">i8", -32: ">f4", -64: ">f8"}


@dataclass(frozen=True, slots=True)
class CountsImage:
    """counts: (ny, nx) int32, read-only; grid: pixels, optical axis and WCS; facts: what the header says."""

    counts: IntImage
    grid: PixelGrid
    facts: ImageFacts


@quiet()
def read_counts_image(
    path: str | Path,
    hdu: int | str | None = None,
    *,
    pixel_scale_arcsec: float | None = None,
    axis_pix: tuple[float, float] | None = None,
) -> CountsImage:
    """A counts image from a FITS file, plain or gzipped.

    hdu: number or EXTNAME; None takes the first image. pixel_scale_arcsec: needed without WCS, must agree with it
    otherwise. axis_pix: (x, y) of the optical axis, first pixel centre at 0; by default RA_PNT, DEC_PNT if inside the
    image, else the image centre. Raises `BadInput` with one sentence for any image that cannot be used.
    """
    unit, primary = read_hdu(path, hdu, "image")
    where = f"{path}[{unit.index}]"
    _refuse_other_shapes(unit, where)
    # The grid first: it needs the header alone, and the pixels may be many.
    grid = _pixel_grid(unit, primary, where, pixel_scale_arcsec, axis_pix)
    counts, note = _whole_counts(unit, where)
    headers = (unit.header,) if unit.index == 0 else (unit.header, primary.header)
    facts = image_facts(headers, where, Path(path).name)
    if note:
        facts = replace(facts, notes=(*facts.notes, note))
    counts.setflags(write=False)
    return CountsImage(counts, grid, facts)


def _refuse_other_shapes(unit: Hdu, where: str) -> None:
    axes = unit.axes
    if len(axes) < 2 or any(length != 1 for length in axes[2:]):
        raise BadInput(where, f"must be a two-dimensional image (got NAXIS = {len(axes)}, {unit.shape or 'no'} pixels)")
    if axes[0] * axes[1] == 0:
        raise BadInput(where, f"the image is empty ({axes[0]} × {axes[1]} pixels)")


def image_values(unit: Hdu, where: str) -> FloatImage:
    """(ny, nx) float64 physical values: BSCALE and BZERO applied, BLANK as NaN. One plane only."""
    _refuse_other_shapes(unit, where)
    return _values_of_rows(unit, where, 0, unit.axes[1])


def _values_of_rows(unit: Hdu, where: str, first: int, stop: int) -> FloatImage:
    """Physical values of rows first … stop − 1."""
    n_x = unit.axes[0]
    bits = int(unit.header["BITPIX"])
    scale, zero = (number(unit.header, key, where) for key in ("BSCALE", "BZERO"))
    if scale == 0.0:
        raise BadInput(where, "BSCALE must not be 0")
    start_byte = first * n_x * abs(bits) // 8
    stored = np.frombuffer(unit.data, dtype=_DTYPES[bits], count=(stop - first) * n_x, offset=start_byte)
    stored = stored.reshape(stop - first, n_x)
    with np.errstate(all="ignore"):
        values = stored.astype(np.float64)
        if scale is not None and scale != 1.0:
            values *= scale
        if zero:
            values += zero
    blank = number(unit.header, "BLANK", where) if bits > 0 else None
    if blank is not None:
        values[stored == blank] = np.nan
    return values


def refuse_where(bad: BoolArray, values: FloatImage, where: str, problem: str) -> None:
    """Raise a sentence naming the number of bad pixels and the first of them."""
    found = _BadPixels()
    found.note(bad, values, 0)
    found.refuse(where, problem)


@dataclass(slots=True)
class _BadPixels:
    """How many pixels are bad in one way, and the first of them: x, y from 0 and its value."""

    n: int = 0
    first: tuple[int, int, float] = (0, 0, 0.0)

    def note(self, bad: BoolArray, values: FloatImage, first_row: int) -> None:
        """Count the bad pixels of some rows; rows come in order."""
        n_more = int(np.count_nonzero(bad))
        if n_more and not self.n:
            y, x = (int(index) for index in np.unravel_index(int(np.argmax(bad)), bad.shape))
            self.first = (x, y + first_row, float(values[y, x]))
        self.n += n_more

    def refuse(self, where: str, problem: str) -> None:
        """Raise `BadInput` if there is one."""
        if self.n:
            x, y, value = self.first
            raise BadInput(
                where,
                f"{problem}; {self.n} pixel{'s are' if self.n > 1 else ' is'} not"
                f" (got {value:g} at FITS pixel {x + 1}, {y + 1})",
            )


def _whole_counts(unit: Hdu, where: str) -> tuple[IntImage, str]:
    """Whole counts, and a note where they had to be restored. In pieces: the largest image has 67 million pixels."""
    n_x, n_y = unit.axes[:2]
    counts = np.empty((n_y, n_x), dtype=np.int32)
    infinite, negative, fractional, large = (_BadPixels() for _ in range(4))
    n_rows = max(1, PIECE_PIXELS // n_x)
    for first in range(0, n_y, n_rows):
        values = _values_of_rows(unit, where, first, min(first + n_rows, n_y))
        with np.errstate(invalid="ignore"):
            nearest = np.rint(values)
            infinite.note(~np.isfinite(values), values, first)
            negative.note(nearest < 0, values, first)
            fractional.note(np.abs(values - nearest) > MAX_FRACTION, values, first)
            large.note(nearest > MAX_COUNTS, values, first)
        if not (infinite.n or negative.n or fractional.n or large.n):
            counts[first : first + n_rows] = nearest
    infinite.refuse(where, "counts must be finite")
    if fractional.n and (restored := _restored(image_values(unit, where))):
        return restored
    advice = " (subtracted or smoothed image? photon counts are needed)" if fractional.n else ""
    negative.refuse(where, f"counts must not be negative{advice}")
    fractional.refuse(where, "counts must be whole numbers (an exposure-corrected or smoothed image cannot be used)")
    large.refuse(where, f"counts must be at most {MAX_COUNTS}")
    return counts, ""


def _restored(values: FloatImage) -> tuple[IntImage, str] | None:
    """Counts from which out-of-time events were subtracted, whole again, and a note that says so."""
    found = restore_whole_counts(values)
    if found is None or found[0].max() > MAX_COUNTS:
        return None
    whole, fraction = found
    missing = float(whole.sum() - values.sum())
    note = (
        f"out-of-time events were subtracted from this image ({fraction:.3g} for each, {missing:.5g} counts"
        " in all); its whole photons are restored and used"
    )
    return whole.astype(np.int32), note


def _pixel_grid(
    unit: Hdu, primary: Hdu, where: str, scale_given_arcsec: float | None, axis_pix: tuple[float, float] | None
) -> PixelGrid:
    n_x, n_y = unit.axes[:2]
    wcs = celestial_wcs(unit.header, where)
    scale_arcsec = scale_given_arcsec
    if scale_given_arcsec is not None:
        refuse_scale(scale_given_arcsec, where)
    if wcs is not None:
        scale_arcsec = pixel_scale_arcsec(wcs, (n_y, n_x), where)
        if scale_given_arcsec is not None and abs(scale_given_arcsec / scale_arcsec - 1.0) > MAX_ANISOTROPY:
            raise BadInput(
                where, f'the pixel scale is given as {scale_given_arcsec:g}" but its WCS says {scale_arcsec:.4g}"'
            )
    if scale_arcsec is None:
        raise BadInput(
            where, "no WCS where one is needed: its header has no celestial coordinates; give the pixel scale"
        )
    refuse_scale(scale_arcsec, where)
    if axis_pix is None:
        axis_pix = _pointing_pix(wcs, (unit, primary), where) or ((n_x - 1) / 2.0, (n_y - 1) / 2.0)
    elif not all(abs(value) < math.inf for value in axis_pix):
        raise BadInput(where, f"the optical axis must be two finite pixel coordinates (got {axis_pix})")
    return PixelGrid((n_y, n_x), scale_arcsec, axis_pix, wcs)


def refuse_scale(scale_arcsec: float, where: str) -> None:
    """Raise `BadInput` for a pixel that no telescope has; a filter would need 10⁹ of them, or none."""
    least, most = SCALE_RANGE_ARCSEC
    if not least <= scale_arcsec <= most:
        raise BadInput(where, f"the pixel scale must be {least:g} to {most:g} arcsec (got {scale_arcsec:g})")


def _pointing_pix(wcs: object, units: tuple[Hdu, Hdu], where: str) -> tuple[float, float] | None:
    """Pixel of RA_PNT, DEC_PNT (the optical axis in OGIP files) if it lies on the image."""
    if wcs is None:
        return None
    n_x, n_y = units[0].axes[:2]
    for unit in units:
        try:
            ra_deg, dec_deg = (number(unit.header, key, where) for key in ("RA_PNT", "DEC_PNT"))
        except BadInput:
            continue
        if ra_deg is None or dec_deg is None:
            continue
        place = pix_of_pointing(wcs, ra_deg, dec_deg)
        if place and -0.5 <= place[0] <= n_x - 0.5 and -0.5 <= place[1] <= n_y - 0.5:
            return place
    return None
