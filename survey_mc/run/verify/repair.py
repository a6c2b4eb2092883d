"""Put a damaged run directory right: remove what is damaged, compute it again, and nothing else.

Idea     campaign and lock file hold each other: the lock has the text of the campaign, the campaign gives the lock. Of
         a stored file the manifest knows what it must be; a file whose line is lost is computed again, because nobody
         knows any more whether it is whole. An unfinished run stays unfinished. What the run did not put there is moved
         to `strays/`, not deleted.
Limits   inputs (sky images, networks) are nowhere else: they have to be put back by hand.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from itertools import pairwise

from survey_mc.campaign import Campaign, Cell, expand, load_run_campaign, parse_campaign
from survey_mc.errors import DamagedStore, SurveyError
from survey_mc.lock_form import loose_content
from survey_mc.run.engine import RunSummary, run_campaign, write_campaign
from survey_mc.run.executors import Executor, ExecutorChoice, open_executor, usable_cores
from survey_mc.run.executors.protocol import Result
from survey_mc.run.order import Order
from survey_mc.run.pack import sweep
from survey_mc.run.quarantine.limits import FieldLimits
from survey_mc.run.work import families_of
from survey_mc.store import Damage, Family, Manifest, Piece, Record, RunLayout
from survey_mc.store.files import is_plain, set_aside, what_it_is, write_whole
from survey_mc.store.journal_lines import drop_damaged_lines
from survey_mc.store.layout import is_journal_name

Ranges = dict[Family, list[tuple[int, int]]]


@dataclass(slots=True)
class Mended:
    """What a repair did. pieces: stored files that were removed. known: what the manifest said of them."""

    campaign: Campaign
    pieces: set[Piece] = field(default_factory=set)
    known: dict[Piece, Record] = field(default_factory=dict)
    tables: bool = False


def mend(layout: RunLayout, manifest: Manifest, damages: Sequence[Damage]) -> Mended:
    """All of a repair that needs no computation. To be called by the holder of the run lock.

    Raises `DamagedStore`, before anything is touched, where only a person can help.
    """
    if not is_plain(layout.manifest) and not any(damage.piece for damage in damages):
        raise DamagedStore(
            f"{layout.root}: has nothing stored (a published run keeps its tables and lock only); `survey-mc run` with "
            "its campaign file makes it again"
        )
    mended = Mended(_campaign_of(layout, manifest, damages), tables=any(d.kind == "table" for d in damages))
    # Strangers first: behind a link among them lies what is not ours.
    for damage in sorted(damages, key=lambda damage: damage.kind != "extra"):
        _remove(layout, damage)
    if any(damage.kind in ("lock", "campaign") for damage in damages):
        text = mended.campaign.text.encode()
        if not is_plain(layout.campaign) or layout.campaign.read_bytes() != text:
            write_whole(layout.campaign, text)
        write_campaign(mended.campaign, layout)
    mended.pieces = {damage.piece for damage in damages if damage.piece is not None}
    mended.known = {piece: record for piece in mended.pieces if (record := manifest.record(piece)) is not None}
    manifest.forget(mended.known)
    manifest.compact()
    sweep(layout, manifest)
    return mended


def _remove(layout: RunLayout, damage: Damage) -> None:
    """Take away what stands where a sound file belongs; what is no file of ours is set aside."""
    path = layout.root / damage.path
    what = what_it_is(path)
    if not what:
        return
    if damage.kind == "extra" or what != "a file" or (damage.kind == "leftover" and layout.inputs in path.parents):
        set_aside(layout.root, damage.path, layout.strays)
    elif damage.kind == "journal" or (path.parent == layout.journals and is_journal_name(path.name)):
        drop_damaged_lines(path)
    elif damage.piece is not None or damage.kind in ("lock", "leftover"):
        path.unlink()


def _campaign_of(layout: RunLayout, manifest: Manifest, damages: Sequence[Damage]) -> Campaign:
    """The campaign that the run was made with, from whichever of its two places is sound."""
    if not any(damage.kind in ("lock", "campaign") for damage in damages):
        return load_run_campaign(layout.root)
    for damage in damages:
        if damage.kind == "campaign" and damage.path != layout.campaign.name:
            raise DamagedStore(
                f"{layout.root / damage.path}: is not what the run was made with and cannot be computed; put it back, "
                "or run the campaign again from the folder that has it"
            )
    # Somebody may have swapped the two files.
    sources = [path for path in (layout.campaign, layout.lock_file) if is_plain(path)]
    locks = [loose_content(path)[0] for path in sources]
    texts = [path.read_bytes().decode("utf-8", errors="replace") for path in sources]
    texts += [text for lock in locks if isinstance(text := lock.get("campaign_text"), str)]
    for text in texts:
        # A digest that fits vouches for the text, whatever else of the lock is damaged.
        if hashlib.sha256(text.encode()).hexdigest() in [lock.get("campaign_sha256") for lock in locks]:
            return parse_campaign(text, str(layout.campaign), layout.inputs)
    for text in texts if any(damage.kind == "lock" for damage in damages) else ():
        campaign = _parsed(text, layout)
        if campaign is not None and _made(campaign, manifest):
            return campaign
    raise DamagedStore(
        f"{layout.root}: nothing in it says any more with which campaign it was made; `survey-mc run` with the "
        "campaign file writes campaign.toml and campaign.lock.json again and keeps what is stored"
    )


def _parsed(text: str, layout: RunLayout) -> Campaign | None:
    try:
        return parse_campaign(text, str(layout.campaign), layout.inputs)
    except SurveyError:
        return None


def _made(campaign: Campaign, manifest: Manifest) -> bool:
    """Whether the stored files are those of a campaign; its keys tell. An empty store is anybody's."""
    return len(manifest) == 0 or any(manifest.records(Family("truth", cell.field_key)) for cell in expand(campaign))


def compute_again(
    layout: RunLayout, mended: Mended, choice: ExecutorChoice | None, limits: FieldLimits | None
) -> tuple[RunSummary, list[str]]:
    """Compute the removed files of the campaign, and say which of them are not what they were."""
    cells = expand(mended.campaign)
    wanted = _ranges(mended.pieces, cells)
    summary = RunSummary(layout.root, fields=0, failed=0, skipped=0, causes={})
    if wanted:
        with ExitStack() as opened:
            executor = OnlyDamaged(choice or ExecutorChoice(), cells, wanted, opened)
            summary = run_campaign(mended.campaign, layout.root, executor, limits=limits)
            summary = replace(summary, fields=executor.fields)
    manifest = Manifest(layout.manifest)
    lacking = sum(_n_lacking(manifest, family, ranges) for family, ranges in wanted.items())
    return replace(summary, failed=lacking), list(_not_the_same(mended, wanted, manifest))


def _ranges(pieces: Iterable[Piece], cells: Iterable[Cell]) -> Ranges:
    """What of the removed files the campaign asks for."""
    wanted: Ranges = {}
    asked = {family: cell.realisations for cell in cells for family in families_of(cell)}
    for piece in sorted(pieces):
        stop = min(piece.stop, asked.get(piece.family, 0))
        if piece.start < stop:
            wanted.setdefault(piece.family, []).append((piece.start, stop))
    return wanted


def _n_lacking(manifest: Manifest, family: Family, ranges: list[tuple[int, int]]) -> int:
    def stored(start: int, stop: int) -> int:
        files = manifest.covering(family, start, stop)
        return sum(min(r.piece.stop, stop) - max(r.piece.start, start) for r in files)

    return sum(max(0, stop - start - stored(start, stop)) for start, stop in ranges)


def _not_the_same(mended: Mended, wanted: Ranges, manifest: Manifest) -> Iterator[str]:
    for piece, before in sorted(mended.known.items()):
        now = manifest.record(piece)
        if piece.family not in wanted:
            yield f"{piece.path}: is of another state of the campaign and was not computed again"
        elif now is not None and now.sha256 != before.sha256:
            yield f"{piece.path}: computed again it is another file than the manifest had; library versions may differ"


class OnlyDamaged:
    """An executor that passes on what of the orders is to replace a removed file: an unfinished run is not gone on
    with.

    fields: how many fields were passed on. The executor behind it is opened for the first order and closed by `opened`.
    """

    name = "repair"
    dashboard: str | None = None

    def __init__(self, choice: ExecutorChoice, cells: tuple[Cell, ...], wanted: Ranges, opened: ExitStack) -> None:
        self.choice, self.cells, self.wanted, self.opened = choice, cells, wanted, opened
        self.workers = 1 if choice.serial else choice.workers or usable_cores()
        self.fields = 0
        self._behind: Executor | None = None

    def workers_now(self) -> int:
        return self._behind.workers_now() if self._behind else self.workers

    def execute(self, orders: Iterable[Order]) -> Iterator[Result]:
        """Outcomes of the parts that were passed on."""
        self._behind = self.opened.enter_context(open_executor(self.choice))
        yield from self._behind.execute(part for order in orders for part in self._parts(order))

    def _parts(self, order: Order) -> Iterator[Order]:
        cell = self.cells[order.cell_index]
        methods = {method.label: method for method in cell.methods}
        truth = self.wanted.get(Family("truth", cell.field_key), []) if order.truth else []
        detect = {m: self.wanted.get(Family("detections", methods[m].detect_key), []) for m in order.detect}
        match = {
            m: [
                *self.wanted.get(Family("matches", methods[m].match_key), []),
                *self.wanted.get(Family("links", methods[m].match_key), []),
            ]
            for m in order.match
        }
        breaks = {order.start, order.stop}
        for ranges in (truth, *detect.values(), *match.values()):
            breaks |= {place for part in ranges for place in part if order.start < place < order.stop}
        places = sorted(breaks)
        for start, stop in pairwise(places):
            to_match = _labels(match, start)
            # Matching needs the detections: where they were never made, they are made now.
            to_detect = tuple(m for m in order.detect if m in _labels(detect, start) or m in to_match)
            if _inside(start, truth) or to_detect or to_match:
                self.fields += stop - start
                yield replace(
                    order, start=start, stop=stop, truth=_inside(start, truth), detect=to_detect, match=to_match
                )


def _labels(ranges: Mapping[str, list[tuple[int, int]]], place: int) -> tuple[str, ...]:
    return tuple(label for label, parts in ranges.items() if _inside(place, parts))


def _inside(place: int, ranges: Iterable[tuple[int, int]]) -> bool:
    return any(start <= place < stop for start, stop in ranges)
