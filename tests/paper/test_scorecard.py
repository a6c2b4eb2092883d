from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from study_stub import SOFT_10, StubResults

from survey_mc.paper.causes import Effect, cause_of, removed_share
from survey_mc.paper.claims import load_claims, parse_value
from survey_mc.paper.options import OPTIONS, Option, option_views
from survey_mc.paper.scorecard import build_scorecard, verdict_counts, write_scorecard
from survey_mc.paper.scorecard_columns import CPU_TABLE, OPTION_EFFECTS, SCORECARD
from survey_mc.paper.statistics import Statistic, evidence_by_claim
from survey_mc.paper.study import TEST_1, TEST_5, study_campaigns
from survey_mc.paper.verdict import judge
from survey_mc.paper.views import SOFT_100

METHODS = ("EMLDETECT", "VTPDETECT", "WAVDETECT", "EWAVELET", "G+SE", "MR/1+SE")
N_IMAGES = 60
RATE_OF_PAPER = 13.0  # false detections of EMLDETECT


def study(false_per_image: float, whole_image: float | None = None, *, is_random: bool = True) -> StubResults:
    """Test 1 with (Poisson) numbers of false detections, and perhaps the option with the whole image."""
    stub = StubResults(N_IMAGES)
    rng = np.random.default_rng(3)
    truth = [
        {"realisation": i, "source_id": s, "kind": "point", "group_id": 0, "group_sep_arcsec": 15.0,
         "counts_onaxis": 100.0} for i in range(N_IMAGES) for s in (0, 1)
    ]  # fmt: skip
    for campaign, rate in ((TEST_1, false_per_image), ("test1_whole_image", whole_image)):
        if rate is None:
            continue
        stub.add(campaign, "truth", truth)
        for method in METHODS:
            rows = [{"realisation": i, "status": "missed", "source_id": 0} for i in range(N_IMAGES)]
            for image, n in enumerate(rng.poisson(rate, N_IMAGES) if is_random else [int(rate)] * N_IMAGES):
                rows += [
                    {"realisation": image, "status": "spurious", "offaxis_arcmin": 5.0 + 12.0 * (rng.random() > 0.5)}
                ] * n
            stub.add(campaign, "matches", rows, method)
    return stub


def row_of(frame: pd.DataFrame, claim: str, **where) -> pd.Series:
    rows = frame[frame["id"] == claim]
    for name, wanted in where.items():
        rows = rows[rows[name] == wanted]
    assert len(rows) == 1
    return rows.iloc[0]


@pytest.fixture(scope="module")
def small_claims():
    return tuple(c for c in load_claims() if c.id.startswith(("test1.emldetect", "test3.eml.flux", "cpu.emldetect")))


def test_every_claim_has_a_row_whatever_was_run():
    scorecard = build_scorecard(study(RATE_OF_PAPER))
    assert list(scorecard.rows["id"]) == [claim.id for claim in load_claims()]
    assert sum(verdict_counts(scorecard.rows).values()) == 187
    not_run = row_of(scorecard.rows, "test5.lost")
    assert (not_run["verdict"], not_run["n"]) == ("not comparable", 0)
    assert TEST_5 in not_run["reason"]
    assert (scorecard.rows.loc[scorecard.rows["verdict"] == "not comparable", "reason"] != "").all()


def test_a_study_like_the_paper_reproduces_and_needs_no_cause(small_claims):
    row = row_of(build_scorecard(study(RATE_OF_PAPER), small_claims).rows, "test1.emldetect.false")
    assert (row["verdict"], row["cause"], row["effect"], row["n"]) == ("reproduced", "", "", N_IMAGES)


def test_a_difference_names_the_option_that_explains_it(small_claims):
    scorecard = build_scorecard(study(4.0, whole_image=RATE_OF_PAPER), small_claims)
    row = row_of(scorecard.rows, "test1.emldetect.false")
    assert (row["verdict"], row["cause"]) == ("differs", "match.region_arcmin = whole image")
    assert (row["effect"], row["cause_verdict"]) == ("explains", "reproduced")
    effect = row_of(scorecard.effects, "test1.emldetect.false", option=row["cause"])
    assert effect["median"] == row["cause_median"] == pytest.approx(13.0, abs=1.0)
    assert effect["share"] == pytest.approx(1.0, abs=0.15)


def test_an_option_that_goes_half_of_the_way_explains_in_part(small_claims):
    row = row_of(build_scorecard(study(0, whole_image=7, is_random=False), small_claims).rows, "test1.emldetect.false")
    assert row["cause"] == "match.region_arcmin = whole image"
    assert row["effect"].startswith("explains in part")


def test_without_option_campaigns_the_cause_is_not_measured(small_claims):
    row = row_of(build_scorecard(study(0.5), small_claims).rows, "test1.emldetect.false")
    assert (row["verdict"], row["cause"]) == ("differs", "")
    assert row["effect"].startswith("not measured")


def test_an_option_that_goes_away_from_the_paper_is_no_cause():
    published = parse_value("4", "sources")
    further = judge(published, np.concatenate((np.full(50, 9.0), np.full(10, 4.0))))
    assert further.verdict == "reproduced"
    effect = Effect("x", Option("a", "b", ("x",)), further, removed_share(published, 8.0, 9.0))
    assert cause_of([effect], True).words == "none found (1 evaluated)"


def test_the_share_of_a_median_at_infinity():
    published = parse_value("2e-15")
    assert removed_share(published, np.inf, 3e-15) == 1.0
    assert removed_share(published, np.inf, np.inf) == 0.0
    assert np.isnan(removed_share(published, 2e-15, 3e-15))


def test_minutes_of_another_machine_get_no_verdict(small_claims):
    row = row_of(build_scorecard(study(RATE_OF_PAPER), small_claims).rows, "cpu.emldetect.minutes")
    assert row["verdict"] == "not comparable"
    assert "cpu_table" in row["reason"]


def test_the_cpu_table_has_our_ratios_beside_the_published_ones(small_claims):
    stub = study(1.0)
    stub.add(TEST_5, "matches", [{"realisation": 0, "status": "missed"}], "MR/1+SE", SOFT_100)
    cost = {"MR/1+SE": 2.0, "EMLDETECT": 5.0}
    stub.journals[TEST_5] = pd.DataFrame(
        [{"cell": SOFT_100, "method": m, "stage": "detect", "fields": 10, "cpu_s": s} for m, s in cost.items()]
    )
    table = build_scorecard(stub, small_claims).cpu.set_index("method")
    assert table.loc["emldetect", "ratio"] == pytest.approx(2.5)
    assert table.loc["emldetect", "paper_ratio"] == pytest.approx(12.0 / 1.9)
    assert np.isnan(table.loc["vtpdetect", "ratio"])


def test_the_same_study_gives_the_same_bytes(tmp_path, small_claims):
    for folder in ("one", "two"):
        write_scorecard(build_scorecard(study(4.0, whole_image=9.0), small_claims), tmp_path / folder)
    for table in (SCORECARD, OPTION_EFFECTS, CPU_TABLE):
        for ending in ("parquet", "csv"):
            name = f"{table.name}.{ending}"
            assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_the_csv_explains_every_column(tmp_path, small_claims):
    write_scorecard(build_scorecard(study(4.0), small_claims), tmp_path)
    text = (tmp_path / "scorecard.csv").read_text(encoding="utf-8")
    for column in SCORECARD.columns:
        assert f"# {column.name}" in text
    frame = pd.read_csv(tmp_path / "scorecard.csv", comment="#")
    assert list(frame.columns) == list(SCORECARD.names)
    assert len(frame) == len(small_claims)


def test_every_option_has_a_name_of_its_own_and_concerns_some_claim():
    names = [option.name for option in OPTIONS]
    assert len(names) == len(set(names))
    used = {o.name for e in evidence_by_claim().values() if isinstance(e, Statistic) for o, _ in option_views(e)}
    assert used >= set(names)


def test_options_name_campaigns_of_the_study():
    known = {campaign.name for campaign in study_campaigns()}
    assert {name for option in OPTIONS for name in (*option.campaigns, *option.campaigns.values())} <= known


def test_no_option_leaves_a_view_as_it_is():
    for evidence in evidence_by_claim().values():
        if isinstance(evidence, Statistic):
            assert all(view != evidence.view for _, view in option_views(evidence))


def test_a_setting_of_one_procedure_does_not_concern_another():
    for evidence in evidence_by_claim().values():
        if isinstance(evidence, Statistic) and evidence.view.methods == ("WAVDETECT",):
            assert not any(option.name.startswith("mr1_se") for option, _ in option_views(evidence))


def test_options_of_the_soft_band_do_not_concern_the_hard_one():
    hard = evidence_by_claim()["test5.limit90.hard.10ks"]
    assert not any(option.name.startswith("sky.model.soft") for option, _ in option_views(hard))


def test_the_core_radii_of_table_2_have_a_measured_cause():
    radii = tuple(claim for claim in load_claims() if claim.id.endswith("core_radius"))
    rows = build_scorecard(StubResults(1), radii).rows
    assert set(rows.loc[rows["verdict"] == "differs", "cause"]) == {"speed of light = 300000 km/s"}
    assert set(rows.loc[rows["verdict"] == "differs", "effect"]) == {"explains"}


def test_a_view_that_needs_what_was_not_run_is_left_out():
    from survey_mc.paper.rows import StudyRows

    stub = study(1.0)
    view = evidence_by_claim()["test1.emldetect.false"].view
    assert StudyRows(stub).lack(view) == ""
    assert "not run" in StudyRows(stub).lack(replace(view, methods=("EMLDETECT modern",)))
    assert "not run" in StudyRows(stub).lack(replace(view, cells=(SOFT_10, SOFT_100)))


def test_a_diagnosis_is_named_only_where_no_reading_helps():
    published = parse_value("4", "sources")
    near, nearer = (judge(published, np.full(50, value)) for value in (4.0, 4.0))
    reading = Effect("x", Option("a reading", "b", ("x",)), near, 0.7)
    diagnosis = Effect("x", Option("a diagnosis", "b", ("x",), is_diagnosis=True), nearer, 1.0)
    assert cause_of([diagnosis, reading], True).effect is reading
    assert cause_of([diagnosis], True).effect is diagnosis
