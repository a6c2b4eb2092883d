"""A stored study made by hand: frames instead of run directories, with known answers."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import pandas as pd

from survey_mc.columns import DETECTIONS, LINKS, MATCHES, TRUTH
from survey_mc.paper.study import study_campaigns

SOFT_10 = "xmm_epic-soft-10ks"
ECF = 6.7e-13
EXPOSURE_KS = {"10ks": 10.0, "100ks": 100.0}
TABLES = {"matches": MATCHES, "truth": TRUTH, "links": LINKS, "detections": DETECTIONS}


@dataclass
class StubResults:
    """Stands for `StudyResults`. rows: (campaign, table, method, cell) → list of dicts of columns."""

    n: int
    rows: dict[tuple[str, str, str, str], list[dict]] = field(default_factory=dict)
    journals: dict[str, pd.DataFrame] = field(default_factory=dict)
    lacking: dict[tuple[str, str], int] = field(default_factory=dict)
    reads: list[tuple[str, ...]] = field(default_factory=list)

    def add(self, campaign: str, table: str, rows: list[dict], method: str = "MR/1+SE", cell: str = SOFT_10) -> None:
        self.rows.setdefault((campaign, table, method, cell), []).extend(rows)

    @property
    def campaigns(self):
        known = {key[0] for key in self.rows}
        return tuple(c for c in study_campaigns() if c.name in known)

    def has(self, campaign: str) -> bool:
        return any(key[0] == campaign for key in self.rows)

    def run(self, campaign: str):
        cells = tuple(dict.fromkeys(key[3] for key in self.rows if key[0] == campaign))
        methods = tuple(dict.fromkeys(key[2] for key in self.rows if key[0] == campaign and key[1] != "truth"))
        return SimpleNamespace(
            cells=cells,
            methods=methods,
            data=SimpleNamespace(cell=self._cell),
            journal=lambda: self.journals.get(campaign, _no_journal()),
        )

    def _cell(self, label: str):
        return SimpleNamespace(
            realisations=self.n, exposure_ks=EXPOSURE_KS[label.split("-")[-1]], flux_per_rate_cgs=ECF
        )

    def n_lacking(self, campaign: str, method: str, cell: str) -> int:
        return self.lacking.get((campaign, method), 0)

    def n_fields(self, campaign: str) -> int:
        return self.n

    def matches(self, campaign, method, rule="nearest", cell=SOFT_10):
        frame = self._frame(campaign, "matches", method, cell)
        return frame[frame["rule"] == rule].reset_index(drop=True)

    def truth(self, campaign, cell=SOFT_10):
        frame = self._frame(campaign, "truth", "MR/1+SE", cell)
        return frame.sort_values(["realisation", "source_id"], ignore_index=True)

    def detections(self, campaign, method, cell=SOFT_10):
        return self._frame(campaign, "detections", method, cell)

    def links(self, campaign, method, cell=SOFT_10):
        return self._frame(campaign, "links", method, cell)

    def _frame(self, campaign, table, method, cell):
        self.reads.append((campaign, table, method, cell))
        rows = [_blank(table) | row for row in self.rows.get((campaign, table, method, cell), [])]
        return pd.DataFrame(
            rows, columns=list(_blank(table)) + [k for k in (rows[0] if rows else {}) if k not in _blank(table)]
        )


def _blank(table: str) -> dict:
    empty = {"int32": -1, "int64": -1, "float64": float("nan"), "bool": False, "string": ""}
    return {c.name: empty[c.dtype] for c in TABLES[table].columns} | ({"rule": "nearest"} if table == "matches" else {})


def _no_journal() -> pd.DataFrame:
    return pd.DataFrame(columns=["cell", "method", "stage", "fields", "cpu_s"])
