"""What asks for more than there is gets a sentence with the limit, in little memory and time."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from bombs import BOMBS
from command import command, less_memory

MEMORY_MORE_BYTES = 400_000_000  # beyond what this process has mapped already
SECONDS = 2.0  # of CPU


@pytest.fixture(scope="module", autouse=True)
def _warm(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Imports are not what is measured."""
    folder = tmp_path_factory.mktemp("warm")
    for name in ("a power of a power", "a unit that is a sum"):
        command(*BOMBS[name][0](folder))


@pytest.mark.parametrize("name", BOMBS, ids=lambda name: name.replace(" ", "_"))
def test_it_is_refused_with_its_limit(tmp_path: Path, name: str) -> None:
    build, word = BOMBS[name]
    words = build(tmp_path)
    start = time.process_time()

    with less_memory(MEMORY_MORE_BYTES):
        answer = command(*words)

    assert time.process_time() - start < SECONDS
    assert answer.code == 2
    assert answer.is_one_sentence
    assert word in answer.err
    assert len(answer.err) < 1500
