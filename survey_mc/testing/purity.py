"""Claims that a procedure is a function: of the observation, its parameters and its generator, and of nothing else."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from survey_mc.testing import fields
from survey_mc.testing.case import Case
from survey_mc.testing.claim import claims_of, expect
from survey_mc.testing.place import expect_same_sources
from survey_mc.types import Observation

IMAGES = ("counts", "photons_pix", "exposure_s", "background")


def inputs_are_not_written(case: Case) -> None:
    """Every array of the observation has the same bytes after the call, and is still read-only."""
    observation = fields.moved(case.plain.observation, 0, 0)
    before = {name: _bytes(observation, name) for name in IMAGES}
    case.find(observation)
    if case.detector.view is not None:
        case.detector.view(observation, case.params)
    for name in IMAGES:
        expect(_bytes(observation, name) == before[name], f"{name} untouched", "other bytes than before")
        array = getattr(observation, name)
        expect(array is None or not array.flags.writeable, f"{name} still read-only", "it was made writeable")


def _bytes(observation: Observation, name: str) -> bytes:
    array = getattr(observation, name)
    return b"" if array is None else array.tobytes()


def same_input_same_rows(case: Case) -> None:
    """The same observation and seed give the same rows, also after another observation in between."""
    first = case.plain_rows
    other = case.draw("another field", fields.lattice(case.rng("other positions"), 3, 5), 900.0)
    case.find(other.observation)
    again = case.find(case.plain.observation)
    expect(again.equals(first), "the same rows again, after another observation", "other rows")


def global_random_state_is_not_used(case: Case) -> None:
    """The generator that is passed in is the only source of random numbers."""
    first = case.plain_rows
    with _restored_random_state():
        np.random.seed(case.seed % 2**32)  # noqa: NPY002  the state a procedure must not look at
        random.seed(case.seed)
        before = _random_state()
        again = case.find(case.plain.observation)
        expect(_random_state() == before, "numpy.random and random left alone", "another state")
    expect(again.equals(first), "the same rows whatever numpy.random.seed was", "other rows")


def _random_state() -> tuple[object, ...]:
    name, key, *rest = np.random.get_state()  # noqa: NPY002
    return (name, np.asarray(key).tobytes(), *rest, random.getstate())


@contextmanager
def _restored_random_state() -> Iterator[None]:
    numpy_state, python_state = np.random.get_state(), random.getstate()  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(numpy_state)  # noqa: NPY002
        random.setstate(python_state)


def photon_order_does_not_matter(case: Case) -> None:
    """The same photons listed in another order give the same sources."""
    mixed = fields.shuffled(case.plain.observation, case.rng("shuffle"))
    expect_same_sources(case, case.find(mixed), case.plain_rows, case.plain.positions, "with shuffled photons")


PURITY_CLAIMS = claims_of(
    inputs_are_not_written, same_input_same_rows, global_random_state_is_not_used, photon_order_does_not_matter
)
