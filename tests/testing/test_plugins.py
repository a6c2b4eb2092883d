"""Procedures of other installed packages: found when they are named, refused with a sentence, harmless when broken."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest
from installed_packages import install

import survey_mc.detect
from survey_mc import testing
from survey_mc.campaign import lock_content, parse_campaign
from survey_mc.campaign.reference import reference
from survey_mc.cli import main
from survey_mc.detect import DETECTORS, Detector, record_problem
from survey_mc.plugins import PluginError, Plugins
from survey_mc.registry import Registry, UnknownName

README = Path(__file__).parents[2] / "README.md"
GROUP = "survey_mc.detectors"


def readme_block(language: str, mark: str) -> str:
    """The first code block of the README in this language that contains the mark."""
    blocks = README.read_text(encoding="utf-8").split(f"```{language}\n")[1:]
    return next(block for block in (b.split("```")[0] for b in blocks) if mark in block)


TOPHAT = readme_block("python", "class TopHatParams")
PROJECT = tomllib.loads(readme_block("toml", "survey_mc.detectors"))


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder on the path of Python; what the registry knew of plug-ins is forgotten."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(DETECTORS, "plugins", Plugins(GROUP, "detector", Detector, record_problem))
    yield tmp_path
    for name, module in list(sys.modules.items()):
        if (getattr(module, "__file__", None) or "").startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.fixture
def tophat(package: Path) -> Detector:
    project = PROJECT["project"]
    install(package, {"tophat.py": TOPHAT}, project["entry-points"][GROUP], project["name"], project["version"])
    return DETECTORS["tophat"]


def test_the_example_of_the_readme_is_short() -> None:
    assert len(TOPHAT.splitlines()) < 40


def test_the_example_of_the_readme_keeps_all_claims(tophat: Detector) -> None:
    assert testing.check_detector(tophat).sound


def test_the_test_of_the_readme_runs(tophat: Detector) -> None:
    namespace: dict[str, object] = {}
    exec(readme_block("python", "testing.CLAIMS"), namespace)  # noqa: S102  our own README

    namespace["test_tophat"](testing.CLAIMS[0])  # type: ignore[operator]


def test_a_plug_in_is_a_detector_like_the_others(tophat: Detector) -> None:
    assert "tophat" in DETECTORS
    assert DETECTORS.names == (*(d.name for d in DETECTORS.built_in), "tophat")
    assert tophat in list(DETECTORS)
    assert tophat not in DETECTORS.built_in
    assert len(DETECTORS) == len(DETECTORS.built_in) + 1


def test_a_campaign_runs_it_and_its_lock_file_says_where_it_came_from(tophat: Detector, tmp_path: Path) -> None:
    from small_campaigns import TEXT

    text = TEXT + '\n[[method]]\nname = "tophat"\nparams = { threshold_sigma = 6.0 }\n'
    (tmp_path / "c.toml").write_text(text)
    lock = lock_content(parse_campaign(text))

    with pytest.raises(SystemExit) as left:
        main(["run", str(tmp_path / "c.toml"), "--serial", "--out", str(tmp_path / "run"), "--no-report"])

    assert left.value.code == 0
    assert lock["methods"][-1]["package"] == "tophat-detector 0.1"
    assert lock["methods"][0]["package"].startswith("survey-mc ")
    assert lock["versions"]["tophat-detector"] == "0.1"


def test_worker_processes_find_it_too(tophat: Detector, package: Path) -> None:
    code = "from survey_mc.detect import DETECTORS; print(DETECTORS['tophat'].label)"
    root = Path(survey_mc.detect.__file__).parents[2]
    environment = {"PYTHONPATH": f"{package}:{root}"}

    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)

    assert done.stdout.strip() == "Top-hat"


def test_the_built_in_ones_are_there_without_looking_at_plug_ins(package: Path) -> None:
    install(package, {"bad.py": "raise SystemExit(3)"}, {"bad": "bad:DETECTOR"})

    assert DETECTORS["gauss_se"].name == "gauss_se"
    assert DETECTORS["mr1_se"].name == "mr1_se"
    assert "bad" not in sys.modules


@pytest.mark.parametrize(
    ("source", "sentence"),
    [
        ("import nothing_like_this", "loading bad:DETECTOR gives ModuleNotFoundError: No module named"),
        ("raise SystemExit(3)", "gives SystemExit: 3"),
        ("DETECTOR = 7", "bad:DETECTOR is not a Detector .got int"),
        ("other = 7", "gives AttributeError"),
        (TOPHAT, "its entry point must have the name of its record, 'tophat'"),
        (TOPHAT.replace('"tophat"', '"bad"').replace('{"paper": PAPER}', "{}"), "profiles must have 'paper'"),
    ],
)
def test_a_broken_plug_in_is_one_sentence_for_those_who_name_it(package: Path, source: str, sentence: str) -> None:
    install(package, {"bad.py": source}, {"bad": "bad:DETECTOR"})

    with pytest.raises(
        PluginError, match=f"detector 'bad' of package tophat-detector 0.1 cannot be used: .*{sentence}"
    ):
        DETECTORS["bad"]
    assert "bad" not in DETECTORS
    assert DETECTORS.names == tuple(d.name for d in DETECTORS.built_in)
    assert list(DETECTORS.refused) == ["bad"]


def test_the_name_of_a_built_in_detector_stays_with_it(package: Path) -> None:
    install(package, {"mine.py": TOPHAT.replace('"tophat"', '"gauss_se"')}, {"gauss_se": "mine:DETECTOR"})

    assert DETECTORS["gauss_se"].label == "G+SE"
    assert len(DETECTORS) == len(DETECTORS.built_in)
    assert "a built-in detector has that name and is used instead" in str(DETECTORS.refused["gauss_se"])


def test_a_name_that_two_packages_offer_is_refused(package: Path) -> None:
    install(package, {"tophat.py": TOPHAT}, {"tophat": "tophat:DETECTOR"})
    install(package, {"hat.py": TOPHAT}, {"tophat": "hat:DETECTOR"}, "hats", "2.0")

    with pytest.raises(PluginError, match=r"hats 2\.0.*the name is taken twice"):
        DETECTORS["tophat"]


def test_an_unknown_name_lists_plug_ins_among_the_known(tophat: Detector) -> None:
    with pytest.raises(UnknownName, match=r"known: .*tophat.*; did you mean 'tophat'"):
        DETECTORS["top_hat"]


def test_the_reference_of_campaign_files_is_the_same_with_plug_ins(tophat: Detector) -> None:
    assert "tophat" not in reference()


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as left:
        main(list(arguments))
    captured = capsys.readouterr()
    return int(left.value.code or 0), captured.out, captured.err


def test_a_campaign_with_a_broken_plug_in_says_whose_it_is(
    package: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from small_campaigns import TEXT

    install(package, {"bad.py": "import nothing_like_this"}, {"bad": "bad:DETECTOR"})
    (tmp_path / "c.toml").write_text(TEXT + '\n[[method]]\nname = "bad"\n')
    code, _, err = run(capsys, "validate", str(tmp_path / "c.toml"))

    assert code == 2
    assert "method[1].name" in err
    assert "of package tophat-detector 0.1 cannot be used" in err


def test_show_methods_lists_usable_plug_ins_and_warns_of_others(
    tophat: Detector, package: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    install(package, {"bad.py": "DETECTOR = None"}, {"bad": "bad:DETECTOR"}, "other", "3")
    del DETECTORS.plugins._offers  # looked up once a process
    code, out, err = run(capsys, "show", "methods", "--json")
    shown = json.loads(out)["tophat"]

    assert code == 0
    assert (shown["label"], shown["version"], shown["package"]) == ("Top-hat", 1, "tophat-detector 0.1")
    assert shown["profiles"]["paper"] == {"radius_pix": 3, "threshold_sigma": 5.0}
    assert err.startswith("warning: detector 'bad' of package other 3 cannot be used")


def test_check_detector_prints_a_line_a_claim(tophat: Detector, capsys: pytest.CaptureFixture[str]) -> None:
    claims = ("--claim", "rows_are_valid", "--claim", "empty_image_gives_no_rows")
    code, out, _ = run(capsys, "check-detector", "tophat", *claims)
    as_json = json.loads(run(capsys, "check-detector", "tophat", *claims, "--json")[1])

    assert code == 0
    assert out.splitlines()[:2] == ["kept           rows_are_valid", "kept           empty_image_gives_no_rows"]
    assert "no claim is broken of 2" in out.splitlines()[-1]
    assert as_json["sound"]
    assert [entry["status"] for entry in as_json["claims"]] == ["kept", "kept"]


def test_check_detector_leaves_with_2_if_a_claim_is_broken(package: Path, capsys: pytest.CaptureFixture[str]) -> None:
    install(
        package, {"tophat.py": TOPHAT.replace("column + dx / n", "column + 3 + 0 * n")}, {"tophat": "tophat:DETECTOR"}
    )
    code, out, _ = run(capsys, "check-detector", "tophat", "--claim", "bright_sources_are_found_in_place")

    assert code == 2
    assert out.startswith("broken         bright_sources_are_found_in_place: expected a detection within 1 pixels")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("nobody",), "unknown detector 'nobody'"),
        (("gauss_se", "--profile", "best"), "unknown profile of gauss_se 'best'"),
        (("gauss_se", "--claim", "beauty"), "unknown claim 'beauty'"),
    ],
)
def test_check_detector_refuses_unknown_names(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], sentence: str
) -> None:
    code, out, err = run(capsys, "check-detector", *arguments)

    assert (code, out) == (2, "")
    assert sentence in err


@dataclass
class Named:
    name: str


def test_a_registry_without_plug_ins_has_its_own_entries_only() -> None:
    registry = Registry("thing", [Named("a"), Named("b")])

    assert (registry.names, len(registry), registry.refused, registry.packages) == (("a", "b"), 2, {}, {})
    assert registry.origin("a") == ""
    assert "c" not in registry
    with pytest.raises(ValueError, match="two things are named 'a'"):
        Registry("thing", [Named("a"), Named("a")])
