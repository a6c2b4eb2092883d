"""The only maker of random generators.

Idea     a generator is a pure function of (content key, stream name): results depend on what is asked for,
         never on the number of workers, the block size, the order of work or a restart.
"""

from __future__ import annotations

import hashlib

import numpy as np


def stream(key: str, name: str) -> np.random.Generator:
    """Generator of the stream `name` ("photons", "positions", …) of the thing with content key `key`.

    Equal arguments give equal streams; streams of different keys or names are independent (128-bit seeds).
    """
    digest = hashlib.blake2b(f"{key}\x1f{name}".encode(), digest_size=16, person=b"survey_mc.rng").digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(digest, "little")))
