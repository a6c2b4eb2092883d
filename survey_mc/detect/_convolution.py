"""Convolution of one image with many kernels by the fast Fourier transform.

Idea     the transforms of the kernels are kept; an image costs one forward transform and one inverse a kernel. The
         image is padded by zeros, so nothing wraps around.
Limits   single precision: rounding is about 1e-7 of the largest value of the answer's sum, far below photon noise.
         Kernels must be point-symmetric (convolution = correlation).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from survey_mc.types import FloatImage

Float32Image = NDArray[np.float32]
Transform = NDArray[np.complex64]


@dataclass(frozen=True, slots=True)
class Convolver:
    """Transforms for images of one shape and kernels up to a half-size (pix)."""

    shape: tuple[int, int]
    largest_half_pix: int

    @property
    def padded(self) -> tuple[int, int]:
        """Transform lengths, ≥ image + half-size of the kernel."""
        height, width = (fft.next_fast_len(n + self.largest_half_pix, real=True) for n in self.shape)
        return height, width

    def kernel(self, kernel: FloatImage) -> Transform:
        """Transform of a (2h + 1)² kernel centred on its middle pixel."""
        half = kernel.shape[0] // 2
        if half > self.largest_half_pix:
            raise ValueError(f"kernel half-size must be at most {self.largest_half_pix} (got {half})")
        padded = np.zeros(self.padded)
        padded[: kernel.shape[0], : kernel.shape[1]] = kernel
        return np.asarray(fft.rfft2(np.roll(padded, (-half, -half), axis=(0, 1))), dtype=np.complex64)

    def image(self, image: NDArray[np.floating]) -> Transform:
        """Transform of an image of the given shape, zero outside."""
        return np.asarray(fft.rfft2(np.asarray(image, dtype=np.float32), s=self.padded))

    def apply(self, image: Transform, kernel: Transform) -> Float32Image:
        """The convolved image, (ny, nx)."""
        both = fft.irfft2(image * kernel, s=self.padded, overwrite_x=True)
        return np.asarray(both[: self.shape[0], : self.shape[1]], dtype=np.float32)
