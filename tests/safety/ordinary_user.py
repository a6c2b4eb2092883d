"""Permissions as an ordinary user meets them, also where the tests run as root."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

CAPABILITY_VERSION_3 = 0x20080522  # capget(2)
DAC_OVERRIDE, DAC_READ_SEARCH = 1, 2  # capabilities(7): root's way around the permissions of files


@contextmanager
def ordinary_user() -> Iterator[None]:
    """Without root's way around permissions; skips the test where that cannot be had."""
    if os.geteuid() != 0:
        yield
        return
    held = _capabilities()
    fewer = held.copy()
    fewer[0] &= ~(1 << DAC_OVERRIDE | 1 << DAC_READ_SEARCH)
    _set_capabilities(fewer)
    try:
        yield
    finally:
        _set_capabilities(held)


def _call(name: str, words: ctypes.Array[ctypes.c_uint32]) -> None:
    header = (ctypes.c_uint32 * 2)(CAPABILITY_VERSION_3, 0)
    try:
        failed = getattr(ctypes.CDLL(None, use_errno=True), name)(header, words)
    except AttributeError:
        failed = -1
    if failed:
        pytest.skip("root keeps its way around permissions here")


def _capabilities() -> list[int]:
    """Effective, permitted and inheritable sets, twice 32 bits each."""
    words = (ctypes.c_uint32 * 6)()
    _call("capget", words)
    return list(words)


def _set_capabilities(words: list[int]) -> None:
    _call("capset", (ctypes.c_uint32 * 6)(*words))
