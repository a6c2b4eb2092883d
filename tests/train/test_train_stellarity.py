"""Training from a campaign: repeatable, honest about its input, and what the shipped file says of itself is true."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from survey_mc.campaign import Campaign, expand, load_campaign, parse_campaign
from survey_mc.cli import main
from survey_mc.detect import DETECTORS
from survey_mc.detect.stellarity import inputs_of_detections, open_network, read_network
from survey_mc.errors import BadInput
from survey_mc.match import match_field
from survey_mc.run import simulate_field
from survey_mc.run.executors import ExecutorChoice
from survey_mc.train import train_stellarity
from survey_mc.train.examples import Examples, split_by_field, thinned
from survey_mc.train.separation import separation

FILE = Path("survey_mc/detect/_sextractor/networks/xmm_epic.nnw")
CAMPAIGN = Path("campaigns/classification_training.toml")
SERIAL = ExecutorChoice(serial=True)

SMALL = """
schema = 1
name = "small_training"
seed = 11

[instrument]
name = "xmm_epic"
n_pix = 256

[sky]
kind = "combined"

[[sky.parts]]
kind = "lognlogs"
flux_min_cgs = 3e-15

[[sky.parts]]
kind = "clusters"
redshifts = [0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9]
radius_arcmin = 7.0
min_separation_arcmin = 2.5

[grid]
exposure_ks = [20.0]
realisations = 25

[[method]]
name = "gauss_se"

[match]
region_arcmin = 8.0
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("training")
    (folder / "small.toml").write_text(SMALL)
    train_stellarity(parse_campaign(SMALL), folder / "run", SERIAL, max_steps=1)
    return folder


def test_training_again_gives_the_same_file(finished: Path) -> None:
    first, second = (train_stellarity(parse_campaign(SMALL), finished / "run", SERIAL, max_steps=60) for _ in range(2))

    assert first.text == second.text
    result = first.separations["G+SE, xmm_epic-soft-20ks"]
    assert result.auc > 0.99  # clusters of 700 counts and more: 1.0000 with each of four other seeds


def test_the_verb_writes_a_network_that_detect_can_use(
    finished: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "own.nnw"
    command = ["train-stellarity", str(finished / "small.toml"), "--run", str(finished / "run")]
    with pytest.raises(SystemExit) as left:
        main([*command, "--out", str(out), "--epochs", "40", "--serial"])

    captured = capsys.readouterr()
    assert left.value.code == 0
    assert "AUC" in captured.out
    assert open_network(str(out)).sizes == (10, 10, 1)
    with pytest.raises(SystemExit) as left:
        main([*command, "--out", str(out), "--serial"])
    assert left.value.code == 2  # it exists


def test_procedures_without_stellarity_cannot_be_trained(finished: Path) -> None:
    other = parse_campaign(SMALL.replace('"gauss_se"', '"ewavelet"').replace("realisations = 25", "realisations = 1"))
    with pytest.raises(BadInput, match=r"method\[0\]\.name: ewavelet has no stellarity index to train"):
        train_stellarity(other, finished / "other", SERIAL)
    assert not (finished / "other").exists()  # refused before an hour of work


def test_too_few_sources_are_refused(finished: Path) -> None:
    few = parse_campaign(SMALL.replace("realisations = 25", "realisations = 5"))
    with pytest.raises(BadInput, match="gives fewer than 20 validation sources of a kind: more fields"):
        train_stellarity(few, finished / "few", SERIAL)


def test_fields_are_never_on_both_sides_and_weights_are_balanced() -> None:
    rng = np.random.default_rng(3)
    examples = Examples(
        rng.normal(size=(900, 10)), rng.random(900) < 0.8, rng.integers(0, 40, 900).astype(np.int32),
        rng.integers(0, 3, 900).astype(np.int32), ("a", "b", "c"),
    )  # fmt: skip
    training, validation = split_by_field(examples)
    few = thinned(training, 50, rng)

    assert not set(training.realisation) & set(validation.realisation)
    assert len(training) + len(validation) == 900
    for group in range(3):
        for is_point in (False, True):
            chosen = (few.group == group) & (few.is_point == is_point)
            assert chosen.sum() <= 50
            assert few.weights()[chosen].sum() == pytest.approx(1.0 / 6.0)


def shipped_head() -> str:
    return "\n".join(line for line in FILE.read_text(encoding="ascii").splitlines() if line.startswith("#"))


def test_the_shipped_file_names_what_it_was_made_of() -> None:
    campaign, head = load_campaign(CAMPAIGN), shipped_head()

    assert f"campaign {campaign.name}, seed {campaign.seed}, {campaign.grid.realisations} realisations" in head
    for cell in expand(campaign):
        assert cell.label in head
    for choice in campaign.method:
        assert f"procedure {choice.name} version {DETECTORS[choice.name].version}" in head
    assert read_network(FILE).sizes == (10, 10, 1)


def fresh_scores(campaign: Campaign, n_fields: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Stellarity and label of sure sources of fields beyond those of the training, 10 ks, by group."""
    cell = expand(campaign)[0]
    parts: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for realisation in range(100_000, 100_000 + n_fields):
        field = simulate_field(campaign, 0, realisation)
        for choice in campaign.method:
            found = DETECTORS[choice.name].detect(field.observation, choice.params, np.random.default_rng(0))
            matches = match_field(field, found, campaign.match, cell.counts_min).matches
            sure = matches[(matches["rule"] == "origin") & (matches["status"] == "matched") & ~matches["is_blend"]]
            joined = sure.merge(found, on="det_id", validate="one_to_one")
            inputs = inputs_of_detections(joined, choice.params, field.observation.psf, 4.0)
            np.testing.assert_array_equal(
                np.clip(open_network("xmm_epic").response(inputs)[:, 0], 0.0, 1.0), joined["stellarity"]
            )
            parts.setdefault(f"{choice.label}, {cell.label}", []).append(
                (joined["stellarity"].to_numpy(), (joined["kind_true"] == "point").to_numpy())
            )
    return {name: tuple(np.concatenate(some) for some in zip(*of, strict=True)) for name, of in parts.items()}


def test_the_shipped_network_separates_unseen_fields_as_its_head_says() -> None:
    said = {
        name.replace(" arcsec", "″"): (float(auc), float(err))
        for name, auc, err in re.findall(r"#   (.+): AUC ([0-9.]+) \+- ([0-9.]+)", shipped_head())
    }

    for name, (score, is_point) in fresh_scores(load_campaign(CAMPAIGN), 6).items():
        result = separation(score, is_point)
        auc, err = said[name]
        # three groups, 1e-4 false alarm in all; the head is the best of many steps on its sources: one more error
        assert abs(result.auc - auc) < 4.2 * math.hypot(result.err, err) + err
