"""Named things a campaign can choose from: detectors, instruments, skies, counts relations.

Idea     an explicit list and a helpful answer to an unknown name; no scanning, no decorators with side effects.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from typing import Generic, Protocol, TypeVar

from survey_mc.errors import SurveyError


class Named(Protocol):
    @property
    def name(self) -> str: ...


T = TypeVar("T", bound=Named)


def nearest_name(name: str, known: Iterable[str]) -> str | None:
    """The known name that looks most like `name`, or None when nothing comes close."""
    return next(iter(difflib.get_close_matches(name, list(known), n=1, cutoff=0.5)), None)


class UnknownName(SurveyError):
    """A name that no registered thing has; the message lists the known ones and the nearest guess."""

    def __init__(self, noun: str, name: str, known: Iterable[str]) -> None:
        names = sorted(known)
        guess = nearest_name(name, names)
        hint = f"; did you mean {guess!r}?" if guess else ""
        super().__init__(f"unknown {noun} {name!r}; known: {', '.join(names)}{hint}")


class Registry(Generic[T]):
    """Ordered collection of named records with unique names."""

    def __init__(self, noun: str, entries: Iterable[T]) -> None:
        self.noun = noun
        self._entries: dict[str, T] = {}
        for entry in entries:
            if entry.name in self._entries:
                raise ValueError(f"two {noun}s are named {entry.name!r}")
            self._entries[entry.name] = entry

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._entries)

    def __getitem__(self, name: str) -> T:
        try:
            return self._entries[name]
        except KeyError:
            raise UnknownName(self.noun, name, self._entries) from None

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[T]:
        return iter(self._entries.values())

    def __len__(self) -> int:
        return len(self._entries)
