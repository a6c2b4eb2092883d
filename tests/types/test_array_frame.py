"""Rows as plain arrays keep what a frame holds, and give it back."""

import numpy as np
import pandas as pd
import pytest

from survey_mc.array_frame import ArrayFrame, Texts


def mixed_frame(n: int = 4) -> pd.DataFrame:
    kinds = (["point", "image", "", "extended"] * n)[:n]
    return pd.DataFrame({
        "id": np.arange(n, dtype=np.int32), "large": np.arange(n) + 2**60, "flag": np.arange(n) % 2 == 0,
        "value": np.linspace(-1.0, 1.0, n) / 3.0, "kind": pd.Series(kinds, dtype="str"),
    })  # fmt: skip


@pytest.mark.parametrize("n_rows", [0, 1, 4])
@pytest.mark.parametrize("names", [["id", "large", "flag", "value", "kind"], ["value", "id", "flag"]])
def test_a_frame_comes_back_as_it_went_in(n_rows, names):
    frame = mixed_frame(n_rows)[names]
    rows = ArrayFrame.of_frame(frame)
    assert len(rows) == n_rows
    pd.testing.assert_frame_equal(rows.frame(), frame)


def test_no_bit_is_lost_in_numbers_of_any_size():
    rng = np.random.default_rng(0)
    frame = pd.DataFrame(
        {
            "small": rng.integers(-(2**31), 2**31, 1000).astype(np.int32),
            "wide": rng.integers(-(2**63), 2**63 - 1, 1000),
            "real": rng.integers(0, 2**63, 1000).view(np.float64),
        }
    )
    for names in (["small", "real"], ["small", "wide", "real"]):
        rows = ArrayFrame.of_frame(frame[names])
        for name in names:
            assert rows[name].dtype == frame[name].dtype
            assert np.array_equal(
                rows[name].view(f"i{rows[name].itemsize}"), frame[name].to_numpy().view(f"i{rows[name].itemsize}")
            )


def test_columns_are_read_only_and_their_frame_is_not():
    rows = ArrayFrame.of_frame(mixed_frame())
    with pytest.raises(ValueError, match="read-only"):
        rows["value"][0] = 1.0
    frame = rows.frame()
    frame.loc[0, "value"] = 7.0
    assert rows["value"][0] != 7.0


def test_tables_one_after_the_other_are_what_pandas_makes_of_them():
    parts = [mixed_frame(3), mixed_frame(0), mixed_frame(4).assign(kind=["new", "point", "", "new"])]
    together = ArrayFrame.together([ArrayFrame.of_frame(part) for part in parts])
    pd.testing.assert_frame_equal(together.frame(), pd.concat(parts, ignore_index=True))


def test_rows_are_chosen_in_order():
    frame = mixed_frame()
    keep = np.array([True, False, True, True])
    chosen = ArrayFrame.of_frame(frame).where(keep).frame()
    pd.testing.assert_frame_equal(chosen, frame[keep].reset_index(drop=True))


def test_texts_are_taken_with_a_word_for_none():
    texts = Texts.of(["b", "a", "b"])
    taken = texts.take(np.array([2, -1, 1, 0]), "none")
    assert [taken.words[code] for code in taken.code] == ["b", "none", "a", "b"]
    assert taken.arrow().to_pylist() == ["b", "none", "a", "b"]
    assert texts.are("b").tolist() == [True, False, True]
    assert not texts.are("missing").any()


def test_texts_and_numbers_are_asked_for_as_such():
    rows = ArrayFrame.of_frame(mixed_frame())
    with pytest.raises(KeyError, match="texts"):
        rows["kind"]
    with pytest.raises(KeyError, match="numbers"):
        rows.texts("value")
