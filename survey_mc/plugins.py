"""Records that other installed packages offer: found by their entry points, loaded when they are first named.

Idea     a package declares an entry point in our group ("tophat = tophat:DETECTOR"); its name is the record's name.
         What cannot be used stays out and has a sentence that says why; nothing else suffers from it.
Source   Python packaging user guide, "Entry points specification".
Limits   what is installed is looked up once a process.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from survey_mc.errors import SurveyError

T = TypeVar("T")


class PluginError(SurveyError):
    """An installed plug-in that cannot be used: whose it is, and why."""

    def __init__(self, noun: str, name: str, origin: str, problem: str) -> None:
        super().__init__(f"{noun} {name!r} of package {origin} cannot be used: {problem}")


class Plugins(Generic[T]):
    """What installed packages offer in one entry-point group.

    kind: the type a record must have. problem: says what is wrong with a record, None if nothing.
    """

    def __init__(self, group: str, noun: str, kind: type[T], problem: Callable[[T], str | None]) -> None:
        self.group, self.noun, self.kind, self.problem = group, noun, kind, problem
        self._loaded: dict[str, T | PluginError] = {}

    @cached_property
    def _offers(self) -> dict[str, list[EntryPoint]]:
        offers: dict[str, list[EntryPoint]] = {}
        for offer in sorted(entry_points(group=self.group), key=lambda e: (e.name, e.value)):
            offers.setdefault(offer.name, []).append(offer)
        return offers

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all offers, usable or not, in alphabetical order."""
        return tuple(self._offers)

    def packages(self, name: str) -> dict[str, str]:
        """Version of each package that offers a record of this name."""
        found = [offer.dist for offer in self._offers.get(name, ())]
        return {dist.name: dist.version for dist in found if dist is not None}

    def origin(self, name: str) -> str:
        """Package and version that offer it ("tophat-detector 0.1"); empty if no package does."""
        return " and ".join(f"{package} {version}" for package, version in self.packages(name).items())

    def refusal(self, name: str, problem: str) -> PluginError:
        """The error that says why an offer cannot be used."""
        return PluginError(self.noun, name, self.origin(name) or "(unknown)", problem)

    def load(self, name: str) -> T | PluginError:
        """The record of an offer, or why it cannot be used."""
        if name not in self._loaded:
            self._loaded[name] = self._load(name)
        return self._loaded[name]

    def _load(self, name: str) -> T | PluginError:
        first, *others = self._offers[name]
        if others:
            return self.refusal(name, "the name is taken twice; uninstall one of the packages")
        try:
            record = first.load()
        except (Exception, SystemExit) as problem:  # a stranger's module can fail in every way
            return self.refusal(name, f"loading {first.value} gives {type(problem).__name__}: {problem}")
        if not isinstance(record, self.kind):
            return self.refusal(name, f"{first.value} is not a {self.kind.__name__} (got {type(record).__name__})")
        own_name = getattr(record, "name", "")
        if own_name != name:
            return self.refusal(name, f"its entry point must have the name of its record, {own_name!r}")
        wrong = self.problem(record)
        return record if wrong is None else self.refusal(name, wrong)
