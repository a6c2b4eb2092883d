import pytest
from fake_run import CELLS, METHODS, FakeCell, FakeMethod, FakeRun, stub_writer

from survey_mc.report import build_report

HOSTILE = "<script>alert('x')</script>$\\frac&\"{"


@pytest.fixture(scope="session")
def small_run():
    return FakeRun(cells=(CELLS[0],), methods=METHODS[:2])


class MixedRun(FakeRun):
    """Every seventh source is extended."""

    def frames(self, table, cell_label, method_label="", columns=None):
        for frame in super().frames(table, cell_label, method_label):
            if table == "matches":
                known = frame["kind_true"] == "point"
                frame.loc[known & (frame["source_id"] % 7 == 0), "kind_true"] = "extended"
            yield frame if columns is None else frame[list(columns)]


@pytest.fixture(scope="session")
def mixed_run():
    return MixedRun(cells=(CELLS[0],), methods=METHODS[:2])


@pytest.fixture(scope="session")
def hostile_page(tmp_path_factory):
    """The page of a run whose every text is out to break it."""
    run = FakeRun(
        cells=(FakeCell("soft", 10.0, 3, name=HOSTILE, instrument=HOSTILE),), methods=(FakeMethod("mr1_se", HOSTILE),)
    )
    method = {"name": "mr1_se", "label": HOSTILE, "version": 1, "reference": HOSTILE, "params": {HOSTILE: HOSTILE}}
    run.lock = {"name": HOSTILE, "about": HOSTILE, "seed": 1, "versions": {HOSTILE: HOSTILE}, "methods": [method]}
    path = build_report(run, tmp_path_factory.mktemp("run"), campaign_text=HOSTILE, write_frame=stub_writer)
    return path.read_text(encoding="utf-8")
