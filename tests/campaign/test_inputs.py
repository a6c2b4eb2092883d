"""The files a campaign names are below its folder, part of the keys, and kept with the run."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_campaigns import TEXT

from survey_mc.campaign import Campaign, expand, load_campaign, load_run_campaign, parse_campaign
from survey_mc.errors import BadInput, DamagedStore
from survey_mc.run import open_run, run_campaign
from survey_mc.run.executors import ExecutorChoice

# Answer ½ and sigmoid(1) to everything.
HALF = "NNW\n2 10 1\n" + "0 " * 10 + "1 " * 10 + "0 " * 10 + "0\n0 1\n"
MORE = HALF.replace("0\n0 1\n", "1\n0 1\n")


def text_with(path: str) -> str:
    return TEXT.replace('label = "G"', f'label = "G"\nparams = {{ stellarity_network = "{path}" }}')


def campaign_with(folder: Path, path: str = "nets/own.nnw", content: str = HALF) -> Campaign:
    (folder / path).parent.mkdir(exist_ok=True, parents=True)
    (folder / path).write_text(content)
    return parse_campaign(text_with(path), "small.toml", folder)


def detect_key(campaign: Campaign) -> str:
    return expand(campaign)[0].methods[0].detect_key


def test_content_of_a_network_enters_the_key_and_its_name_does_not(tmp_path: Path) -> None:
    key = detect_key(campaign_with(tmp_path / "a"))

    assert detect_key(campaign_with(tmp_path / "b")) == key
    assert detect_key(campaign_with(tmp_path / "a", "other.nnw")) == key
    assert detect_key(campaign_with(tmp_path / "a", content=MORE)) != key
    assert detect_key(parse_campaign(TEXT)) != key


@pytest.mark.parametrize(
    "path", ["../up.nnw", "/etc/x.nnw", "~/x.nnw", "a\\u0000.nnw", "link.nnw", "gone.nnw", "c:x.nnw"]
)
def test_a_network_must_stay_below_the_campaign(tmp_path: Path, path: str) -> None:
    (tmp_path / "inside").mkdir()
    (tmp_path / "up.nnw").write_text(HALF)
    (tmp_path / "inside" / "link.nnw").symlink_to(tmp_path / "up.nnw")

    with pytest.raises(BadInput, match=r"small\.toml: method\[0\]\.params\.stellarity_network: file"):
        parse_campaign(text_with(path), "small.toml", tmp_path / "inside")


def test_a_bad_network_is_refused_with_the_campaign(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"small\.toml: method\[0\]\.params: .*own\.nnw: line 1: must begin with NNW"):
        campaign_with(tmp_path, content="no network")


def test_a_run_keeps_the_network_and_does_again_what_another_gives(tmp_path: Path) -> None:
    folder, run = tmp_path / "campaign", tmp_path / "run"
    serial = ExecutorChoice(serial=True)
    run_campaign(campaign_with(folder), run, serial)
    first = open_run(run).detections()["stellarity"]

    assert (run / "inputs" / "nets" / "own.nnw").read_text() == HALF
    assert first.eq(0.5).all()
    assert len(first)
    assert detect_key(load_run_campaign(run)) == detect_key(campaign_with(folder))

    assert run_campaign(campaign_with(folder, content=MORE), run, serial).fields == 6
    assert open_run(run).detections()["stellarity"].gt(0.7).all()

    (run / "inputs" / "nets" / "own.nnw").write_text(HALF)
    with pytest.raises(DamagedStore, match="inputs"):
        load_run_campaign(run)


def test_a_network_that_changes_under_a_run_is_a_failure_and_no_result(tmp_path: Path) -> None:
    campaign = campaign_with(tmp_path)
    (tmp_path / "nets" / "own.nnw").write_text(MORE)

    summary = run_campaign(campaign, tmp_path / "run", ExecutorChoice(serial=True))

    assert summary.failed == 6


def test_a_loaded_file_finds_its_network_beside_it(tmp_path: Path) -> None:
    campaign_with(tmp_path)
    (tmp_path / "small.toml").write_text(text_with("nets/own.nnw"))

    assert load_campaign(tmp_path / "small.toml").input_digests.keys() == {"nets/own.nnw"}
