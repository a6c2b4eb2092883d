"""Pixel-integrated radial tables of a PSF and of the PSF convolved with source shapes, for fast fits.

Idea     a pixel of an image sees the PSF averaged over its area. Its mean over position angle depends on radius alone,
         so one cubic spline in radius gives the model and its analytic derivatives.
         Extended shapes fold rings of that table: the mean of a β-model (exponent −3/2) over a ring is a complete
         elliptic integral, that of a Gaussian a Bessel function.
Source   extent models of the XMM-SAS task emldetect (Gaussian; β-model (1 + r²/r_c²)^−3/2); integrals textbook.
Limits   the four-fold part of the pixel window is left out: at most 0.4 % of the value for FWHM 1.5 pixels, growing for
         a PSF narrower than a pixel. Nothing beyond `REACH_PIX`.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.special import ellipe, ive

from survey_mc.caches import bounded_cache
from survey_mc.types import FloatArray, Psf

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

ExtentModel = Literal["beta", "gaussian", "none"]

STEPS_PER_PIX = 8
REACH_PIX = 256
EXTENT_STEP = 0.085  # in ln(extent): linear interpolation is then good to 0.4 % of the peak
LARGEST_TABLES = 16  # sets of tables kept
TINY = 1e-300  # stands for 0 in logarithms

_NODES_PER_PIX = 20  # Gauss-Legendre nodes along a pixel side
_ANGLES = 8  # over one octant of position angle
_SMOOTH_FROM_PIX = 12.0  # beyond, a few nodes integrate a pixel exactly
_RINGS_PER_PIX = 4  # rings of the table that stand for the PSF near its centre …
_RINGS_FAR = 120  # … and geometrically spaced ones beyond
_NEAR_PIX = 16.0
_FAR_PIX = 4000.0
_PROFILE_RADII = 160


@dataclass(frozen=True, slots=True)
class PsfTable:
    """Radial tables of source shapes, fraction of the counts per pixel.

    cubics: (1 + n_extents, n_intervals, 4) value Σ c_j t^j at the radius (k + t) / STEPS_PER_PIX, 0 ≤ t ≤ 1; row 0 is a
    point.
    extent_pix: (n_extents,) geometric sequence of extents of the rows 1 …; empty without extent model.
    r50_pix: (1 + n_extents,) half-energy radius of each row, before pixel integration for row 0.
    """

    cubics: FloatArray
    extent_pix: FloatArray
    r50_pix: FloatArray

    def half_energy_pix(self, extent_pix: FloatArray) -> FloatArray:
        """Half-energy radius (pixels) of shapes with these extents; 0 is a point."""
        radius = np.full(np.shape(extent_pix), self.r50_pix[0])
        extended = np.asarray(extent_pix) > 0.0
        if extended.any():
            place = np.log(np.asarray(extent_pix)[extended])
            radius[extended] = np.interp(place, np.log(self.extent_pix), self.r50_pix[1:])
        return radius


def _pixel_mean(psf: Psf, scale_arcsec: float, radius_pix: FloatArray, n_nodes: int) -> FloatArray:
    """PSF integrated over a pixel whose centre is at each radius, averaged over position angle."""
    nodes, weights = np.polynomial.legendre.leggauss(n_nodes)
    angle = (np.arange(_ANGLES) + 0.5) * (math.pi / 4.0 / _ANGLES)
    x = (radius_pix[:, None] * np.cos(angle))[:, :, None, None] + nodes[:, None] / 2.0
    y = (radius_pix[:, None] * np.sin(angle))[:, :, None, None] + nodes[None, :] / 2.0
    density = psf.surface_brightness(np.hypot(x, y) * scale_arcsec) * scale_arcsec**2
    return np.asarray(np.einsum("raij,i,j->r", density, weights, weights) / (4.0 * _ANGLES))


def point_profile(psf: Psf, scale_arcsec: float) -> FloatArray:
    """Fraction of the counts in a pixel at radius k / STEPS_PER_PIX, k = 0 … REACH_PIX · STEPS_PER_PIX."""
    radius = np.arange(REACH_PIX * STEPS_PER_PIX + 1) / STEPS_PER_PIX
    near = radius < _SMOOTH_FROM_PIX
    profile = np.empty(radius.size)
    profile[near] = _pixel_mean(psf, scale_arcsec, radius[near], _NODES_PER_PIX)
    profile[~near] = psf.surface_brightness(radius[~near] * scale_arcsec) * scale_arcsec**2
    return profile


def _spline(place: FloatArray, values: FloatArray, **ends: Any) -> CubicSpline:
    from scipy.interpolate import CubicSpline  # a driver does without

    return CubicSpline(place, values, **ends)


def _ring_masses(psf: Psf, scale_arcsec: float, profile: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Radii (pixels) of rings and the share of the counts each stands for; the shares sum to 1."""
    near_edges = np.arange(int(_NEAR_PIX * _RINGS_PER_PIX) + 1) / _RINGS_PER_PIX
    fine = np.linspace(0.0, _NEAR_PIX, int(_NEAR_PIX * STEPS_PER_PIX) + 1)
    inside = _spline(fine, 2.0 * math.pi * fine * profile[: fine.size]).antiderivative()(near_edges)
    far_edges = np.geomspace(_NEAR_PIX, _FAR_PIX, _RINGS_FAR + 1)
    beyond = inside[-1] + np.diff(np.asarray(psf.encircled_energy(far_edges * scale_arcsec))).cumsum()
    edges = np.concatenate([near_edges, far_edges[1:]])
    mass = np.diff(np.concatenate([inside, beyond]))
    radius = np.sqrt((edges[:-1] ** 2 + edges[1:] ** 2) / 2.0)
    return radius, np.maximum(mass, 0.0) / mass.sum()


def _ring_mean(kind: ExtentModel, radius: FloatArray, ring: FloatArray, extent: float) -> FloatArray:
    """Unit-integral kernel at `radius` averaged over a ring around the origin; all in pixels, broadcast."""
    if kind == "gaussian":
        spread = extent**2
        bessel = ive(0, radius * ring / spread)
        return np.asarray(bessel * np.exp(-((radius - ring) ** 2) / (2.0 * spread)) / (2.0 * math.pi * spread))
    nearest = 1.0 + ((radius - ring) / extent) ** 2
    farthest = 1.0 + ((radius + ring) / extent) ** 2
    elliptic = ellipe(1.0 - nearest / farthest)
    return np.asarray(elliptic / (nearest * np.sqrt(farthest)) / (math.pi * extent) ** 2)


def _cubics(profile: FloatArray) -> FloatArray:
    """(n_radii − 1, 4) coefficients of the spline through a profile, its slope 0 at the centre."""
    place = np.arange(profile.size, dtype=np.float64)
    return np.ascontiguousarray(_spline(place, profile, bc_type=((1, 0.0), (2, 0.0))).c[::-1].T)


def _extended_rows(
    kind: ExtentModel, extents: FloatArray, ring: FloatArray, mass: FloatArray
) -> tuple[list[FloatArray], list[float]]:
    """Splines and half-energy radii of the PSF convolved with kernels of each extent."""
    coarse = np.sinh(np.linspace(0.0, math.asinh(REACH_PIX + 1.0), _PROFILE_RADII))
    radius = np.arange(REACH_PIX * STEPS_PER_PIX + 1) / STEPS_PER_PIX
    rows, r50 = [], []
    for extent in extents:
        folded = _ring_mean(kind, coarse[:, None], ring[None, :], float(extent)) @ mass
        logarithm = _spline(np.arcsinh(coarse), np.log(np.maximum(folded, TINY)))
        profile = np.exp(logarithm(np.arcsinh(radius)))
        rows.append(_cubics(profile))
        inside = np.concatenate([[0.0], np.cumsum(np.diff(radius**2) * (profile[1:] + profile[:-1]) / 2.0) * math.pi])
        r50.append(float(np.interp(0.5, inside, radius)))
    return rows, r50


def extent_nodes(extent_min_pix: float, extent_max_pix: float) -> FloatArray:
    """Extents of the tables: from half the smallest accepted one, so that a fit can fall below it, to the largest."""
    n = math.ceil(math.log(2.0 * extent_max_pix / extent_min_pix) / EXTENT_STEP) + 1
    return np.geomspace(extent_min_pix / 2.0, extent_max_pix, max(n, 2))


_TABLES: OrderedDict[tuple[object, ...], PsfTable] = OrderedDict()


@bounded_cache(8)
def _probe_radii(scale_arcsec: float) -> FloatArray:
    return np.asarray(np.geomspace(1e-3, 1e3, 96) * scale_arcsec)


def psf_table(
    psf: Psf, scale_arcsec: float, kind: ExtentModel = "none", extent_min_pix: float = 1.5, extent_max_pix: float = 20.0
) -> PsfTable:
    """Tables of a PSF; made once for every PSF that has the same values, whatever object carries it."""
    probe = _probe_radii(scale_arcsec)
    shape = () if kind == "none" else (extent_min_pix, extent_max_pix)
    likeness = np.concatenate([psf.surface_brightness(probe), psf.encircled_energy(probe)]).tobytes()
    key = (likeness, scale_arcsec, kind, *shape)
    if key in _TABLES:
        _TABLES.move_to_end(key)
        return _TABLES[key]
    profile = point_profile(psf, scale_arcsec)
    rows, r50 = [_cubics(profile)], [psf.hew_arcsec / 2.0 / scale_arcsec]
    extents = np.zeros(0)
    if kind != "none":
        extents = extent_nodes(extent_min_pix, extent_max_pix)
        more_rows, more_r50 = _extended_rows(kind, extents, *_ring_masses(psf, scale_arcsec, profile))
        rows, r50 = rows + more_rows, r50 + more_r50
    table = PsfTable(np.ascontiguousarray(np.stack(rows)), extents, np.array(r50))
    for values in (table.cubics, table.extent_pix, table.r50_pix):
        values.setflags(write=False)
    _TABLES[key] = table
    while len(_TABLES) > LARGEST_TABLES:
        _TABLES.popitem(last=False)
    return table
