"""A report of many fields takes the memory of a report of few."""

import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from fake_run import FakeCell, FakeMethod, FakeRun
from small_campaigns import small

from survey_mc.campaign import load_run_campaign
from survey_mc.report import field_process
from survey_mc.report.field_process import one_field_figures
from survey_mc.report.tables import aggregate
from survey_mc.run import run_campaign
from survey_mc.run.executors import ExecutorChoice
from survey_mc.store import RunData

FIELDS_IN_PIECE = 100
METHOD = FakeMethod("gauss_se", "G")


class RepeatedRun(FakeRun):
    """The same hundred fields of a few sources over and over, a piece each time."""

    def frames(self, table, cell_label, method_label="", columns=None):
        rows = pd.concat(FakeRun((FakeCell("soft", 10.0, 2),), (METHOD,)).frames(table, cell_label, METHOD.label))
        few = rows.iloc[:: max(len(rows) // 300, 1)]
        for start in range(0, self.cells[0].realisations, FIELDS_IN_PIECE):
            piece = few.assign(realisation=start + np.arange(len(few)) * FIELDS_IN_PIECE // len(few))
            yield piece if columns is None else piece[list(columns)]


def peak_bytes(n_fields):
    run = RepeatedRun((FakeCell("soft", 10.0, n_fields),), (METHOD,))
    tracemalloc.start()
    try:
        tables = aggregate(run)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert tables["status_counts"]["n_fields"].eq(n_fields).all()
    return peak


def test_memory_of_the_tables_does_not_grow_with_the_number_of_fields():
    peak_bytes(FIELDS_IN_PIECE)  # what is imported and cached once is no growth
    few, many = peak_bytes(1_000), peak_bytes(3_000)
    # A piece of matches is 50 kB: to hold those of 2000 fields more would take 1 MB.
    assert many - few < 200_000


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> RunData:
    root = tmp_path_factory.mktemp("a run") / "rün"
    run_campaign(small(("realisations = 6", "realisations = 1")), root, ExecutorChoice(serial=True))
    return RunData(root)


def test_a_process_of_its_own_draws_the_same_pictures(stored: RunData, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign = load_run_campaign(stored.layout.root)
    here = one_field_figures(stored, campaign)
    monkeypatch.setattr(field_process, "COMPILER", "a module that nobody loads")
    apart = one_field_figures(stored, campaign)
    assert here.problem == apart.problem == ""
    assert [figure.name for figure in here.figures] == ["field_images", "field_outcomes"]
    assert apart == here


def test_why_there_is_no_picture_is_said_in_one_line(stored: RunData, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(field_process, "COMPILER", "a module that nobody loads")
    lost = RunData(stored.layout.root)
    lost.layout = type(lost.layout)(Path("/nowhere/at all"))
    problem = one_field_figures(lost, load_run_campaign(stored.layout.root)).problem
    assert "is not a run directory" in problem
    assert "\n" not in problem
    monkeypatch.setattr(sys, "executable", "/bin/false")
    assert one_field_figures(stored, load_run_campaign(stored.layout.root)).problem == "the process ended with 1"
