"""What `plan` foretells: costs from journals to the last digit, bytes and files like those of the run."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_campaigns import MR1, small

from survey_mc.campaign import Campaign, expand
from survey_mc.run import plan_campaign, run_campaign
from survey_mc.run.engine import write_campaign
from survey_mc.run.executors import ExecutorChoice
from survey_mc.run.plan import campaign_plan as plan_module
from survey_mc.run.plan.costs import Sample
from survey_mc.store import Family, Manifest, Piece, Record, RunLayout
from survey_mc.store.journal_lines import seal_line

SERIAL = ExecutorChoice(serial=True)
BAR = 0.3
FIELD_S = {("", "draw"): 0.25, ("", "commit"): 0.01, ("G", "detect"): 2.0, ("G", "match"): 0.5, ("G", "commit"): 0.02}


def of_fields(n: int, *changes: tuple[str, str], extra: str = "") -> Campaign:
    many = (("realisations = 6", f"realisations = {n}"), ("realisations_per_file = 4", "realisations_per_file = 16"))
    return small(*many, *changes, extra=extra)


def journalled(root: Path, campaign: Campaign, stored: int) -> Path:
    """A run directory in which some fields are done, at costs of `FIELD_S` each (a commit: and each table)."""
    layout = RunLayout(root)
    layout.journals.mkdir(parents=True)
    write_campaign(campaign, layout)
    (cell,) = expand(campaign)
    n_tables = {"": 1, "G": 3}
    costs = []
    for (method, stage), cpu_s in FIELD_S.items():
        n = stored * (n_tables[method] if stage == "commit" else 1)
        costs.append({"method": method, "stage": stage, "fields": n, "cpu_s": cpu_s * n, "wall_s": 99.0})
    task = {"event": "task", "run": "r", "at": "2026-01-01T00:00:00+00:00", "cell": cell.label, "start": 0, "stop": stored,  # noqa: E501
            "costs": costs}  # fmt: skip
    (layout.journals / "20260101T000000.000000Z-1.jsonl").write_text(seal_line(task))
    keys = cell.methods[0]
    families = [Family("truth", cell.field_key), Family("detections", keys.detect_key),
                Family("matches", keys.match_key), Family("links", keys.match_key)]  # fmt: skip
    Manifest(layout.manifest).add(Record(Piece(f, 0, stored), "0" * 64, 100, 200_000, 1) for f in families)
    return root


def size_and_files(root: Path) -> tuple[int, int]:
    files = list((root / "store").rglob("*.parquet"))
    return sum(path.stat().st_size for path in files), len(files)


def test_costs_of_the_journal_are_those_of_the_plan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan_module, "sample", None)  # nothing has to be computed
    campaign = of_fields(80)
    plan = plan_campaign(campaign, journalled(tmp_path / "run", campaign, 16), workers=4)
    assert (plan.to_do, plan.fields, plan.measured) == (64, 80, "journal")
    commits = {place: cpu_s for place, cpu_s in plan.stages.items() if place[1] == "commit"}
    assert commits == {("", "commit"): pytest.approx(0.64), ("G", "commit"): pytest.approx(3 * 64 * 0.02)}
    for place in (("", "draw"), ("G", "detect"), ("G", "match")):
        assert plan.stages[place] == pytest.approx(64 * FIELD_S[place])
    # orders of five fields: every file is written in parts
    assert plan.stages["", "pack"] == pytest.approx(plan_module.PACKING_PER_COMMIT * sum(commits.values()))
    assert plan.cpu_s == pytest.approx(sum(plan.stages.values()))
    assert plan.files == 5 * 4
    assert plan.new_files == 4 * 4
    # the files that there are hold 16 fields in 200 kB each
    assert plan.size_bytes == pytest.approx(4 * 4 * 200_000, rel=0.01)


def test_an_order_is_no_longer_than_its_fields_take(tmp_path: Path) -> None:
    campaign = of_fields(80)
    plan = plan_campaign(campaign, journalled(tmp_path / "run", campaign, 16), workers=1)
    assert plan.block == 8
    assert plan.orders == 4 * 4  # 2.8 s a field, 15 s an order: 5 fields and the rest of a file of 16


def test_more_workers_take_less_time_but_never_none(tmp_path: Path) -> None:
    campaign = of_fields(80)
    plan = plan_campaign(campaign, journalled(tmp_path / "run", campaign, 16), workers=4)
    walls = [plan.wall_s(n) for n in (1, 2, 4, 8)]
    assert walls == sorted(walls, reverse=True)
    assert walls[0] > plan.cpu_s
    assert walls[1] == pytest.approx(plan.cpu_s / 2, rel=0.2)
    assert plan.wall_s(1000) > plan_module.CLUSTER_START_S
    finished = of_fields(16)
    done = plan_campaign(finished, journalled(tmp_path / "done", finished, 16))
    assert (done.wall_s(2), done.cpu_s, done.size_bytes, done.measured) == (0.0, 0.0, 0, "nothing to do")


def test_only_what_no_journal_tells_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[set[str]] = []

    def remember(campaign: Campaign, cell: object, labels: set[str]) -> Sample:
        asked.append(set(labels))
        return Sample({("M", "detect"): 4.0, ("M", "match"): 1.0}, {}, ("M fails",))

    monkeypatch.setattr(plan_module, "sample", remember)
    root = journalled(tmp_path / "run", of_fields(32), 16)
    plan = plan_campaign(of_fields(32, extra=MR1), root)
    assert asked == [{"M"}]
    assert plan.measured == "journal and a few fields"
    assert plan.problems == ("M fails",)
    assert plan.stages["M", "detect"] == pytest.approx(32 * 4.0)
    assert plan.stages["G", "detect"] == pytest.approx(16 * 2.0)
    assert plan.stages["", "draw"] == pytest.approx(32 * 0.25)  # for the new method the old fields are drawn again


def test_bytes_and_files_are_like_those_of_the_run(tmp_path: Path) -> None:
    root, before = tmp_path / "run", (0, 0)
    wider = ("[match]", "[match]\nradius_arcsec = 9.0")
    for campaign in (of_fields(20), of_fields(40, extra=MR1), of_fields(40, wider, extra=MR1)):
        plan = plan_campaign(campaign, root)
        assert size_and_files(root) == before  # nothing is written
        run_campaign(campaign, root, SERIAL)
        after = size_and_files(root)
        assert plan.new_files == after[1] - before[1]
        assert plan.size_bytes == pytest.approx(after[0] - before[0], rel=BAR)
        assert not plan.problems
        before = after
    assert plan_campaign(campaign, root).to_do == 0
