"""The study: which campaigns it has, how large they are, and that they are what they say."""

from __future__ import annotations

from pathlib import Path

import pytest

from survey_mc.campaign import Campaign, expand, load_campaign, load_resized
from survey_mc.errors import BadInput
from survey_mc.paper.reproduce import run_study
from survey_mc.paper.study import BASE, OPTIONS, StudyCampaign, StudySize, study_campaigns

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
ALL = tuple(study_campaigns())
PROCEDURES = {"emldetect", "vtpdetect", "wavdetect", "ewavelet", "gauss_se", "mr1_se"}


def loaded(study: StudyCampaign) -> Campaign:
    return load_campaign(study.file(CAMPAIGNS))


@pytest.mark.parametrize("study", ALL, ids=lambda s: s.name)
def test_every_campaign_of_the_study_loads_and_is_called_as_its_file(study: StudyCampaign) -> None:
    assert load_resized(study.file(CAMPAIGNS), 7).grid.realisations == 7
    assert loaded(study).name == study.name


def test_every_option_file_is_part_of_the_study() -> None:
    assert {path.stem for path in (CAMPAIGNS / "options").glob("*.toml")} == {option.name for option in OPTIONS}


@pytest.mark.parametrize("base", BASE, ids=lambda s: s.name)
def test_base_campaigns_have_all_six_procedures_of_the_paper(base: StudyCampaign) -> None:
    assert {method.name for method in loaded(base).method} == PROCEDURES


@pytest.mark.parametrize("option", OPTIONS, ids=lambda s: s.name)
def test_an_option_has_the_seed_and_the_sizes_of_its_base(option: StudyCampaign) -> None:
    base = next(study for study in BASE if study.name == option.base)
    assert loaded(option).seed == loaded(base).seed
    assert option.scale == base.scale


@pytest.mark.parametrize("name", ["test1_options", "test2_options", "test3_options", "test4_options", "test5_options"])
def test_settings_of_procedures_are_tried_on_the_very_same_images(name: str) -> None:
    option = next(study for study in OPTIONS if study.name == name)
    base = next(study for study in BASE if study.name == option.base)
    fields = {cell.label: cell.field_key for cell in expand(loaded(base))}
    assert all(fields[cell.label] == cell.field_key for cell in expand(loaded(option)))


def test_points_of_test_4_are_those_of_test_3() -> None:
    from survey_mc.campaign import draw_truth

    points, both = (next(s for s in BASE if s.name.startswith(f"test{n}")) for n in (3, 4))
    alone, with_clusters = (draw_truth(loaded(s), expand(loaded(s))[0], 0).sources for s in (points, both))
    kept = with_clusters[with_clusters["kind"] == "point"].reset_index(drop=True)
    assert kept.equals(alone)
    assert sorted(with_clusters.loc[with_clusters["kind"] == "extended", "redshift"]) == [0.6, 1.0, 1.5, 1.8, 2.0]


def test_without_a_word_the_study_has_the_papers_numbers_and_grows_with_one() -> None:
    assert StudySize.of(None, None) == StudySize(10, 1)
    assert StudySize.of(50, None) == StudySize(50, 200)
    assert StudySize.of(50, 7) == StudySize(50, 7)
    assert StudySize.of(3, None) == StudySize(3, 1)
    sizes = {study.name: StudySize(50, 200).fields(study) for study in ALL}
    assert (sizes["test1_point_pairs"], sizes["test5_completeness"]) == (200, 50)
    assert sizes["test1_options"] == 50


@pytest.mark.parametrize("asked", [(0, None), (-1, None), (0, 5)])
def test_no_realisations_are_not_the_default_number(asked: tuple[int, int | None]) -> None:
    with pytest.raises(BadInput, match=r"--realisations must be 1\.\.100000"):
        StudySize.of(*asked)


@pytest.mark.parametrize("size", [(0, 1), (10, -1), (10**9, 1)])
def test_impossible_sizes_are_one_sentence(size: tuple[int, int]) -> None:
    with pytest.raises(BadInput, match=r"must be 1\.\.100000"):
        StudySize(*size)


def test_a_folder_without_the_campaigns_is_one_sentence_and_nothing_is_made(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such campaign file; run this where the `campaigns` folder is"):
        run_study(StudySize(), tmp_path / "out", tmp_path)
    assert not (tmp_path / "out").exists()


def test_campaigns_share_one_executor_and_a_second_start_has_nothing_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from survey_mc.paper import reproduce
    from survey_mc.run.executors import ExecutorChoice

    folder = tmp_path / "campaigns"
    folder.mkdir()
    for name in ("first", "second"):
        text = (CAMPAIGNS / "test1_point_pairs.toml").read_text(encoding="utf-8")
        text = text.replace("test1_point_pairs", name).split("method = [")
        text = [text[0], text[1].split("]\n", 1)[1]]
        (folder / f"{name}.toml").write_text('method = [{ name = "gauss_se" }]\n'.join(text), encoding="utf-8")
    chosen = (StudyCampaign("first", "images"), StudyCampaign("second", "realisations"))
    monkeypatch.setattr(reproduce, "study_campaigns", lambda with_options=True: chosen)
    done = run_study(StudySize(2, 1), tmp_path / "out", folder, ExecutorChoice(serial=True))
    again = run_study(StudySize(2, 1), tmp_path / "out", folder, ExecutorChoice(serial=True))
    assert done.complete
    assert (done.fields, again.fields) == (3, 0)


@pytest.mark.parametrize(
    ("size", "decides"), [((10, 1), False), ((50, 200), True), ((39, 39), True), ((100, 38), False)]
)
def test_options_are_run_where_a_verdict_is_possible(size: tuple[int, int], decides: bool) -> None:
    from survey_mc.paper.verdict import LEAST_VALUES, TAIL

    assert StudySize(*size).decides is decides
    assert 1.0 / (LEAST_VALUES + 1) == TAIL
