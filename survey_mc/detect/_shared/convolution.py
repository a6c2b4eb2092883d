"""Convolution of one image with many kernels by the fast Fourier transform.

Idea     the transforms of the kernels are kept; an image costs one forward transform and one inverse a kernel. The
         image is padded by zeros, so nothing wraps around. What of a kernel reaches beyond the image is never used.
Limits   single precision: rounding is about 1e-7 of the largest value of the answer's sum, far below photon noise.
         Kernels must be point-symmetric (convolution = correlation), so their transforms are real.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from survey_mc.types import FloatImage

Float32Image = NDArray[np.float32]
Transform = NDArray[np.complex64]
KernelTransform = NDArray[np.float32]


def reach_pix(half_pix: int, n_pix: int) -> int:
    """Largest offset at which a kernel of the given half-size can touch an image of n_pix."""
    return min(half_pix, n_pix - 1)


@dataclass(frozen=True, slots=True)
class Convolver:
    """Transforms for images of one shape and kernels up to a half-size (pix), which may exceed the image."""

    shape: tuple[int, int]
    largest_half_pix: int

    @property
    def padded(self) -> tuple[int, int]:
        """Transform lengths, ≥ image + reach of the kernel."""
        height, width = (fft.next_fast_len(n + reach_pix(self.largest_half_pix, n), real=True) for n in self.shape)
        return height, width

    def kernel(self, kernel: FloatImage) -> KernelTransform:
        """Transform of a (2h + 1)² kernel centred on its middle pixel."""
        half = kernel.shape[0] // 2
        if half > self.largest_half_pix:
            raise ValueError(f"kernel half-size must be at most {self.largest_half_pix} (got {half})")
        up, across = (reach_pix(half, n) for n in self.shape)
        used = kernel[half - up : half + up + 1, half - across : half + across + 1]
        padded = np.zeros(self.padded)
        padded[: used.shape[0], : used.shape[1]] = used
        return np.asarray(fft.rfft2(np.roll(padded, (-up, -across), axis=(0, 1))).real, dtype=np.float32)

    def image(self, image: NDArray[np.floating]) -> Transform:
        """Transform of an image of the given shape, zero outside."""
        height, width = self.padded
        along_rows = fft.rfft(np.asarray(image, dtype=np.float32), width, axis=1)
        return np.asarray(fft.fft(along_rows, height, axis=0, overwrite_x=True))

    def apply(self, image: Transform, kernel: KernelTransform) -> Float32Image:
        """The convolved image, (ny, nx)."""
        # Columns first: the padding's rows then need no inverse, which is faster than one call for both axes.
        height, width = self.shape
        rows = fft.ifft(image * kernel, axis=0, overwrite_x=True)[:height]
        return np.ascontiguousarray(fft.irfft(rows, self.padded[1], axis=1)[:, :width], dtype=np.float32)
