"""Named things a campaign can choose from: detectors, instruments, skies, counts relations.

Idea     an explicit list and a helpful answer to an unknown name; no scanning, no decorators with side effects. A
         registry may also have a group of entry points, for records of other installed packages.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from typing import Generic, Protocol, TypeVar

from survey_mc.errors import SurveyError
from survey_mc.plugins import PluginError, Plugins


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
    """Ordered collection of named records with unique names: the built-in ones, then those of other packages.

    plugins: what other installed packages offer. A built-in record needs no look at them, and a plug-in that cannot be
    used is an error only for those who name it.
    """

    def __init__(self, noun: str, entries: Iterable[T], plugins: Plugins[T] | None = None) -> None:
        self.noun = noun
        self.plugins = plugins
        self._entries: dict[str, T] = {}
        for entry in entries:
            if entry.name in self._entries:
                raise ValueError(f"two {noun}s are named {entry.name!r}")
            self._entries[entry.name] = entry

    @property
    def built_in(self) -> tuple[T, ...]:
        """The records of this package."""
        return tuple(self._entries.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all records that can be used."""
        return tuple(entry.name for entry in self)

    @property
    def refused(self) -> dict[str, PluginError]:
        """Installed plug-ins that cannot be used, by name, and why."""
        offers = {name: self._offer(name) for name in self._offered()}
        return {name: offer for name, offer in offers.items() if isinstance(offer, PluginError)}

    def origin(self, name: str) -> str:
        """Package and version a record comes from; empty for a built-in one."""
        return "" if name in self._entries or self.plugins is None else self.plugins.origin(name)

    @property
    def packages(self) -> dict[str, str]:
        """Version of each further package that offers a record."""
        offers = (self.plugins.packages(name) for name in self._offered() if self.plugins is not None)
        return {package: version for offer in offers for package, version in offer.items()}

    def why_not(self, name: str, noun: str = "") -> SurveyError:
        """The error for a name that cannot be used; noun: what the reader calls it."""
        offer = self._offer(name)
        return offer if isinstance(offer, PluginError) else UnknownName(noun or self.noun, name, self.names)

    def __getitem__(self, name: str) -> T:
        found = self._entries[name] if name in self._entries else self._offer(name)
        if found is None or isinstance(found, PluginError):
            raise self.why_not(name)
        return found

    def __contains__(self, name: object) -> bool:
        return name in self._entries or not isinstance(self._offer(name), PluginError | None)

    def __iter__(self) -> Iterator[T]:
        yield from self._entries.values()
        for name in self._offered():
            offer = self._offer(name)
            if offer is not None and not isinstance(offer, PluginError):
                yield offer

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def _offered(self) -> tuple[str, ...]:
        return () if self.plugins is None else self.plugins.names

    def _offer(self, name: object) -> T | PluginError | None:
        """The plug-in of a name, or why it cannot be used; None if no package offers one."""
        if self.plugins is None or not isinstance(name, str) or name not in self.plugins.names:
            return None
        if name in self._entries:
            return self.plugins.refusal(name, f"a built-in {self.noun} has that name and is used instead; rename it")
        return self.plugins.load(name)
