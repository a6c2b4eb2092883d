"""The à trous B3-spline wavelet transform and its adjoint reconstruction.

Idea     c₀ = image; c_{s+1} = h_s ⋆ c_s with h = [1, 4, 6, 4, 1]/16 and 2^s − 1 holes; w_s = c_s − c_{s+1}. The adjoint
         scheme rebuilds U ← h_s ⋆ U + w_s from the coarsest plane down.
Source   Starck & Pierre 1998 A&AS 128, 397; Starck, Murtagh & Bijaoui 1998.
Limits   the reach 2^(s+1) of every scale must stay below the image size (one reflection). float32 planes.

Each kernel smooths one row at a time: five source rows are mixed into a padded buffer, which is then mixed along
itself. Contiguous row views keep the inner loops free of index arithmetic, so they become vector instructions; no
reductions are reordered, hence the results are bit-identical everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Plane = NDArray[np.float32]
Planes = NDArray[np.float32]
Support = NDArray[np.uint8]

BORDER_MIRROR = 0  # x[−i] = x[i]
BORDER_NEAREST = 1  # x[−i] = x[0]
REACH_STEPS = 2  # the five-tap filter reaches two steps to each side

SMOOTH, FORWARD, FORWARD_MASKED, ADJOINT = 0, 1, 2, 3  # what `filter_plane` does besides smoothing

TAP_CENTRE = np.float32(6.0 / 16.0)
TAP_NEAR = np.float32(4.0 / 16.0)
TAP_FAR = np.float32(1.0 / 16.0)


@njit(cache=True)
def border_index(i: int, n: int, border: int) -> int:
    """Index inside 0 … n−1 that stands for i outside of it."""
    if border == BORDER_NEAREST:
        return min(max(i, 0), n - 1)
    if i < 0:
        return -i
    return 2 * (n - 1) - i if i >= n else i


@njit(cache=True)
def mix_rows(far_a: Plane, near_a: Plane, centre: Plane, near_b: Plane, far_b: Plane, out: Plane) -> None:
    """out = (far + 4 near + 6 centre + 4 near + far) / 16, element by element."""
    for i in range(out.shape[0]):
        out[i] = TAP_FAR * (far_a[i] + far_b[i]) + TAP_NEAR * (near_a[i] + near_b[i]) + TAP_CENTRE * centre[i]


@njit(cache=True)
def smooth_row(source: Plane, y: int, step: int, border: int, padded: Plane, out: Plane) -> None:
    """Row y of h_s ⋆ source. padded: scratch of at least width + 4·step."""
    height, width = source.shape
    reach = REACH_STEPS * step
    mix_rows(
        source[border_index(y - reach, height, border)],
        source[border_index(y - step, height, border)],
        source[y],
        source[border_index(y + step, height, border)],
        source[border_index(y + reach, height, border)],
        padded[reach : reach + width],
    )
    for i in range(1, reach + 1):
        padded[reach - i] = padded[reach + border_index(-i, width, border)]
        padded[reach + width - 1 + i] = padded[reach + border_index(width - 1 + i, width, border)]
    mix_rows(
        padded[:width],
        padded[step : step + width],
        padded[reach : reach + width],
        padded[reach + step : reach + step + width],
        padded[2 * reach : 2 * reach + width],
        out,
    )


@njit(cache=True)
def filter_plane(
    source: Plane, step: int, border: int, mode: int, keep: Support, padded: Plane, wavelet: Plane, out: Plane
) -> None:
    """out = h_s ⋆ source, and what the mode asks for besides, while the rows are still in the cache.

    mode FORWARD: wavelet = source − out; FORWARD_MASKED: the same, zero where keep is 0; ADJOINT: out += wavelet;
    SMOOTH: nothing besides. One kernel with a mode, because a compilation costs more than the branch.
    """
    for y in range(source.shape[0]):
        given, row, plane_row, keep_row = source[y], out[y], wavelet[y], keep[y]
        smooth_row(source, y, step, border, padded, row)
        if mode == FORWARD:
            for x in range(row.shape[0]):
                plane_row[x] = given[x] - row[x]
        elif mode == FORWARD_MASKED:
            for x in range(row.shape[0]):
                plane_row[x] = (given[x] - row[x]) * keep_row[x]
        elif mode == ADJOINT:
            for x in range(row.shape[0]):
                row[x] += plane_row[x]


@njit(cache=True)
def update_solution(image: Plane, correction: Plane, keep_positive: bool, solution: Plane, residual: Plane) -> float:
    """S ← S + U, clipped at zero if asked; R ← I − S; returns ΣR² (float64, one partial sum a column)."""
    energy = np.zeros(image.shape[1])
    floor = np.float32(0.0) if keep_positive else np.float32(-np.inf)
    for y in range(image.shape[0]):
        given, change, estimate, rest = image[y], correction[y], solution[y], residual[y]
        for x in range(given.shape[0]):
            value = max(estimate[x] + change[x], floor)
            estimate[x] = value
            left = given[x] - value
            rest[x] = left
            energy[x] += np.float64(left) * np.float64(left)
    return float(energy.sum())


@dataclass(frozen=True, slots=True)
class Workspace:
    """Buffers of a transform, made once per image: fresh megabytes in every iteration would cost as much as the filter.

    planes: (n_planes, ny, nx) wavelet planes; padded: scratch row; images: two scratch images; no_mask: stands for a
    support that is not read.
    """

    planes: Planes
    padded: Plane
    images: tuple[Plane, Plane]
    no_mask: Support

    @classmethod
    def of(cls, shape: tuple[int, ...], n_planes: int) -> Workspace:
        """Buffers for n_planes wavelet planes of an image; the scratch row is long enough for the coarsest."""
        row = np.empty(shape[1] + 2 * REACH_STEPS * 2 ** max(n_planes - 1, 0), np.float32)
        images = (np.empty(shape, np.float32), np.empty(shape, np.float32))
        return cls(np.zeros((n_planes, *shape), np.float32), row, images, np.zeros(shape, np.uint8))


def transform(image: Plane, work: Workspace, border: int, first: int = 0, support: Support | None = None) -> Plane:
    """Fill work.planes[first:] with the wavelet planes, finest first; returns the last smooth plane.

    support: (n_planes, ny, nx) 0/1; coefficients outside of it are set to zero. The smooth plane is one of the scratch
    images: use it before the next call.
    """
    source = image
    for s, plane in enumerate(work.planes):
        target = work.images[s % 2]
        keep = work.no_mask if support is None else support[s]
        used = FORWARD if support is None else FORWARD_MASKED
        filter_plane(source, 2**s, border, used if s >= first else SMOOTH, keep, work.padded, plane, target)
        source = target
    return source


def reconstruct(smooth: Plane, work: Workspace, border: int, first: int = 0, adjoint: bool = True) -> Plane:
    """Image of work.planes[first:] and the smooth plane, by the adjoint scheme or by the plain sum.

    The plain sum of all the planes is the exact inverse of `transform`. The result is one of the scratch images.
    """
    if not adjoint:
        smooth += work.planes[first:].sum(axis=0, dtype=np.float32)
        return smooth
    source = smooth
    for s in range(len(work.planes) - 1, -1, -1):
        target = work.images[0] if source is work.images[1] else work.images[1]
        mode = ADJOINT if s >= first else SMOOTH
        filter_plane(source, 2**s, border, mode, work.no_mask, work.padded, work.planes[s], target)
        source = target
    return source


@njit(cache=True)
def box_counts_limits(
    events: NDArray[np.float64],
    half_size: int,
    border: int,
    lower_table: NDArray[np.float64],
    upper_table: NDArray[np.float64],
    scale_factor: float,
    lower: Plane,
    upper: Plane,
) -> None:
    """Limits of the coefficients of one scale from the photons in the box around every pixel.

    events: (ny, nx) photons; the box has (2·half_size + 1)² pixels. The tables hold the limits of the finest scale for
    n = 0, 1, … photons and are multiplied by scale_factor; beyond their end they grow as √n.
    """
    height, width = events.shape
    last = lower_table.shape[0] - 1
    side = 2 * half_size + 1
    column_sum = np.zeros(width)
    running = np.zeros(width + side)
    for y in range(-half_size, half_size + 1):
        column_sum += events[border_index(y, height, border)]
    for y in range(height):
        running[0] = 0.0
        for i in range(width + side - 1):
            running[i + 1] = running[i] + column_sum[border_index(i - half_size, width, border)]
        for x in range(width):
            n = int(running[x + side] - running[x] + 0.5)
            stretch = scale_factor
            if n > last:
                stretch = scale_factor * np.sqrt(n / last)
                n = last
            lower[y, x] = lower_table[n] * stretch
            upper[y, x] = upper_table[n] * stretch
        if y + 1 < height:
            column_sum += events[border_index(y + half_size + 1, height, border)]
            column_sum -= events[border_index(y - half_size, height, border)]


@njit(cache=True)
def kill_isolated(support: Support) -> Support:
    """Support without the pixels that have no 4-neighbour in their plane and nothing at their place one plane up.

    The last plane has no plane above and is left as it is.
    """
    n_planes, height, width = support.shape
    cleaned = support.copy()
    for s in range(n_planes - 1):
        for y in range(height):
            for x in range(width):
                if support[s, y, x] and not support[s + 1, y, x]:
                    alone = (
                        (y == 0 or not support[s, y - 1, x])
                        and (y == height - 1 or not support[s, y + 1, x])
                        and (x == 0 or not support[s, y, x - 1])
                        and (x == width - 1 or not support[s, y, x + 1])
                    )
                    if alone:
                        cleaned[s, y, x] = 0
    return cleaned
