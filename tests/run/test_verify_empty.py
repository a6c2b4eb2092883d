"""Nothing to find is a result: empty tables with all their columns and types, which readers and the report take."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from damaged_runs import call

from survey_mc.campaign import parse_campaign
from survey_mc.run import open_run, run_campaign, verify_run
from survey_mc.run.executors import ExecutorChoice
from survey_mc.run.rows import table_of
from survey_mc.store import Manifest
from survey_mc.store.parquet import piece_table

TEXT = """
schema = 1
name = "empty"
seed = 3

[instrument]
name = "xmm_epic"
n_pix = {n_pix}
{instrument}

[sky]
{sky}

[grid]
band = ["soft"]
exposure_ks = [10.0]
realisations = 2

[match]
region_arcmin = 1.0
counts_min = 10

[[method]]
name = "gauss_se"
label = "G"
"""
POINTS = 'kind = "lognlogs"\nflux_min_cgs = 1e-15'
NOTHING = 'kind = "empty"'
CASES = {
    "no photons": (64, "field_of_view = false\nbackground = false", NOTHING),
    "no sources": (64, "field_of_view = false", NOTHING),
    "all masked": (64, "field_of_view_arcmin = 0.001", POINTS),
    "smallest image": (16, "field_of_view = false", POINTS),
    "one pixel in view": (17, "field_of_view_arcmin = 0.001", POINTS),
}


def text_of(case: str) -> str:
    n_pix, instrument, sky = CASES[case]
    return TEXT.format(n_pix=n_pix, instrument=instrument, sky=sky)


@pytest.mark.parametrize("case", CASES)
def test_empty_tables_have_the_whole_schema_and_are_sound(tmp_path: Path, case: str) -> None:
    campaign = parse_campaign(text_of(case))
    assert run_campaign(campaign, tmp_path / "run", ExecutorChoice(serial=True)).complete

    assert verify_run(tmp_path / "run", n_replay=2).sound
    run = open_run(tmp_path / "run")
    for record in Manifest(tmp_path / "run" / "manifest.jsonl"):
        declared = table_of(record.piece.family.table, "gauss_se")
        assert piece_table(run.data.layout, record.piece) == declared
        types = pq.read_schema(tmp_path / "run" / record.piece.path).types
        assert pa.null() not in types
    frames = {"truth": run.truth(), "detections": run.detections(), "matches": run.matches(), "links": run.links()}
    for name, frame in frames.items():
        declared = table_of(name, "gauss_se")  # type: ignore[arg-type]
        kinds = {c.name: "str" if c.dtype == "string" else c.dtype for c in declared.columns}
        assert {column: str(frame[column].dtype).replace("string", "str") for column in kinds} == kinds
    if case in ("no photons", "all masked"):
        assert [len(frame) for frame in frames.values()] == [0, 0, 0, 0]


def test_the_report_of_nothing_is_a_report(tmp_path: Path) -> None:
    (tmp_path / "empty.toml").write_text(text_of("no photons"))

    code, said = call("run", tmp_path / "empty.toml", "--serial", "--out", tmp_path / "run")

    assert code == 0, said
    assert (tmp_path / "run" / "report" / "index.html").stat().st_size > 10_000
    types = {kind for path in (tmp_path / "run" / "tables").glob("*.parquet") for kind in pq.read_schema(path).types}
    assert pa.null() not in types
    assert call("verify", tmp_path / "run")[0] == 0
