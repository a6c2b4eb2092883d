"""A campaign with another number of realisations is the same campaign, longer or shorter."""

from __future__ import annotations

from pathlib import Path

import pytest

from survey_mc.campaign import expand, load_campaign, load_resized
from survey_mc.errors import BadInput

SMOKE = Path(__file__).parents[2] / "campaigns" / "smoke.toml"


def test_resizing_changes_nothing_but_the_number() -> None:
    as_written, longer = load_campaign(SMOKE), load_resized(SMOKE, 77)
    assert longer.grid.realisations == 77
    assert longer.text.replace("realisations = 77", f"realisations = {as_written.grid.realisations}") == as_written.text
    assert [cell.field_key for cell in expand(longer)] == [cell.field_key for cell in expand(as_written)]
    assert [m.match_key for c in expand(longer) for m in c.methods] == [
        m.match_key for c in expand(as_written) for m in c.methods
    ]


def test_comments_survive_and_a_number_that_cannot_be_is_refused_like_any_other(tmp_path: Path) -> None:
    assert "#" in load_resized(SMOKE, 3).text
    with pytest.raises(BadInput, match="realisations"):
        load_resized(SMOKE, 0)


@pytest.mark.parametrize("line", ["", "realisations = 3\nrealisations = 4"])
def test_a_file_without_one_line_of_realisations_is_a_sentence(tmp_path: Path, line: str) -> None:
    path = tmp_path / "odd.toml"
    path.write_text(f"[grid]\n{line}\n", encoding="utf-8")
    with pytest.raises(BadInput, match=r"one line `realisations = …`.*found"):
        load_resized(path, 5)
