"""A study's folder: what is not whole is said and not counted, what is foreign is left alone."""

from __future__ import annotations

import shutil
from pathlib import Path

import pandas as pd
import pytest

from survey_mc.campaign import load_resized
from survey_mc.errors import BadInput
from survey_mc.paper import StudyResults, report_study, run_study
from survey_mc.paper.figures import test1
from survey_mc.paper.lacking import lack, lacking_fields
from survey_mc.paper.study import TEST_1, TEST_4, StudyCampaign, StudySize
from survey_mc.paper.study_lock import PUBLISHED_TABLES, differences, read_study_lock, write_study_lock
from survey_mc.paper.views import View
from survey_mc.report import make_report
from survey_mc.run import run_campaign
from survey_mc.run.executors import ExecutorChoice

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
SERIAL = ExecutorChoice(serial=True)
SICK, HALF_SICK = "WAVDETECT", "G+SE"


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Test 1 with two images; one procedure fails always and another in one image."""
    from survey_mc.run import task

    whole = task.detect_on

    def detect_on(campaign, method, field, realisation):
        if method.label == SICK or (method.label == HALF_SICK and realisation == 1):
            raise ArithmeticError("planted <b>&amp;</b>")
        return whole(campaign, method, field, realisation)

    root = tmp_path_factory.mktemp("study")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(task, "detect_on", detect_on)
        run_campaign(load_resized(CAMPAIGNS / f"{TEST_1}.toml", 2), root / TEST_1, SERIAL)
    return root


def test_a_field_that_failed_is_not_one_without_detections(study: Path) -> None:
    results = StudyResults(study)

    assert lacking_fields(results, TEST_1) == "Lacks 2 fields of WAVDETECT, 1 field of G+SE."
    assert lack(results, View(TEST_1)) == ""
    assert lack(results, View(TEST_1, ("G+SE",))) == f"was not run whole: {TEST_1} lacks 1 field of G+SE"
    assert lack(results, View(TEST_4)) == f"was not run: {TEST_4}"


def test_a_study_with_failures_is_published_and_says_so(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "survey_mc.paper.publish.study_figures", test1.test1_figures
    )  # the others take time and tell nothing
    page = report_study(study).read_text(encoding="utf-8")
    rows = pd.read_csv(study / "scorecard.csv", comment="#", keep_default_na=False)
    of_sick = rows[rows["reason"].str.contains("not run whole")]

    assert "Lacks 2 fields of WAVDETECT, 1 field of G+SE." in page
    assert "planted" not in page
    assert len(of_sick) > 3
    assert set(of_sick["verdict"]) == {"not comparable"}
    assert set(of_sick["n"].astype(int)) == {0}


def test_a_folder_with_lock_files_alone_is_no_study(study: Path, tmp_path: Path) -> None:
    """As in a fresh clone of a repository that keeps the results of a study and not its stores."""
    (tmp_path / TEST_1).mkdir()
    for name in ("campaign.toml", "campaign.lock.json"):
        shutil.copy(study / TEST_1 / name, tmp_path / TEST_1)

    assert StudyResults(tmp_path).campaigns == ()
    with pytest.raises(BadInput, match="holds no run of the study"):
        report_study(tmp_path)


@pytest.mark.parametrize(
    ("taken", "sentence"),
    [("index.html", "has a index.html already"), ("campaign.lock.json", "run directory of one campaign")],
)
def test_a_folder_of_somebody_else_is_left_alone(tmp_path: Path, taken: str, sentence: str) -> None:
    (tmp_path / taken).write_text("mine")

    with pytest.raises(BadInput, match=sentence):
        run_study(StudySize(), tmp_path, CAMPAIGNS, SERIAL)
    assert [path.name for path in tmp_path.iterdir()] == [taken]


def test_a_campaign_file_of_another_name_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from survey_mc.paper import reproduce

    shutil.copy(CAMPAIGNS / "smoke.toml", tmp_path / "first.toml")
    monkeypatch.setattr(reproduce, "study_campaigns", lambda with_options=True: (StudyCampaign("first", "images"),))
    with pytest.raises(BadInput, match=r"first\.toml: name: must be 'first'"):
        run_study(StudySize(), tmp_path / "out", tmp_path, SERIAL)
    assert not (tmp_path / "out").exists()


def test_a_lock_says_what_was_made_and_what_is_not_the_same_any_more(study: Path, tmp_path: Path) -> None:
    results = StudyResults(study)
    for name in PUBLISHED_TABLES:
        (study / name).write_text("id\n", encoding="utf-8")
    write_study_lock(results, tmp_path / "lock.json")
    lock = read_study_lock(tmp_path / "lock.json")

    assert lock["command"] == "survey-mc paper --images 2 --no-options"
    assert differences(lock, results) == []
    (study / "scorecard.csv").write_text("id\nchanged\n", encoding="utf-8")
    lock["runs"][TEST_1]["versions"]["numpy"] = "0.1"
    lock["runs"]["another"] = lock["runs"][TEST_1]
    found = differences(lock, results)
    assert "scorecard.csv: differs" in found
    assert "another: was not run" in found
    assert any(line.startswith(f"{TEST_1}: numpy ") and line.endswith("the lock has 0.1") for line in found)


@pytest.mark.parametrize("text", [None, "", "[]", '{"lock_schema": 1}', '{"lock_schema": 2}'])
def test_what_is_no_lock_of_a_study_is_one_sentence(tmp_path: Path, text: str | None) -> None:
    if text is not None:
        (tmp_path / "lock.json").write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=r"lock\.json"):
        read_study_lock(tmp_path / "lock.json")


def test_a_published_run_without_its_store_keeps_its_tables(study: Path, tmp_path: Path) -> None:
    shutil.copytree(study / TEST_1, tmp_path / "run", ignore=shutil.ignore_patterns("manifest.jsonl", "store"))
    with pytest.raises(BadInput, match="has nothing stored"):
        make_report(tmp_path / "run")
