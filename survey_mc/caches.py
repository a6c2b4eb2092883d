"""Bounded caches of what is costly to make and the same for many fields: kernels, thresholds, instrument maps.

Idea     each is as large as one campaign needs; a worker that serves one campaign after the other empties all of them
         in between, so that its memory does not grow with the number of campaigns.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import _lru_cache_wrapper, lru_cache
from typing import TypeVar

T = TypeVar("T")
_caches: list[_lru_cache_wrapper[object]] = []


def bounded_cache(maxsize: int) -> Callable[[Callable[..., T]], _lru_cache_wrapper[T]]:
    """`functools.lru_cache` with a size, known to `forget_all`."""

    def wrap(function: Callable[..., T]) -> _lru_cache_wrapper[T]:
        cached = lru_cache(maxsize=maxsize)(function)
        _caches.append(cached)  # type: ignore[arg-type]
        return cached

    return wrap


def forget_all() -> None:
    """Empty every cache."""
    for cached in _caches:
        cached.cache_clear()
