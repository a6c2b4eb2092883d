"""SExtractor's text format of neural networks: read, written, evaluated by hand."""

from __future__ import annotations

import math
import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from survey_mc.detect._sextractor.nnw import Network, network_text, parse_network, read_network
from survey_mc.errors import BadInput

# Two inputs, two hidden neurons, one output, comments and line breaks anywhere.
SMALL = """NNW made by hand
# any comment
 3 2 2 1   # layers and their sizes

 1.0 -1.0  # input biases
 2.0
 0.5
 1.0 0.0 0.0   # neuron 1: weights of the inputs, bias
 0.0 1.0 2.0
 3.0 -1.0 0.25
 0.5
 2.0
"""


def logistic(x: float) -> float:
    return 1.0 / (1.0 + math.exp(-x))


def test_answer_of_a_small_network_is_the_one_computed_by_hand() -> None:
    network = parse_network(SMALL, "small")
    first, second = logistic(2.0 * 0.75 + 1.0), logistic(0.5 * -4.0 - 1.0 + 2.0)
    by_hand = (logistic(3.0 * first - second + 0.25) - 0.5) / 2.0

    assert network.sizes == (2, 2, 1)
    assert network.response(np.array([[0.75, -4.0]]))[0, 0] == pytest.approx(by_hand, rel=1e-14)


def test_neurons_saturate_without_overflow() -> None:
    network = parse_network("NNW\n2 1 1\n0 1\n1 0\n0 1\n", "step")

    with np.errstate(all="raise"):
        answer = network.response(np.array([[-1e6], [1e6]]))[:, 0]

    np.testing.assert_allclose(answer, [0.0, 1.0], atol=1e-200)


@given(
    sizes=st.lists(st.integers(1, 5), min_size=2, max_size=4),
    seed=st.integers(0, 1000),
    comments=st.lists(st.text("abc #123", max_size=20), max_size=3),
)
def test_a_written_network_is_read_back(sizes: list[int], seed: int, comments: list[str]) -> None:
    rng = np.random.default_rng(seed)
    layers = tuple((rng.normal(size=(b, a)), rng.normal(size=b)) for a, b in pairwise(sizes))
    network = Network(
        rng.normal(size=sizes[0]), rng.normal(size=sizes[0]), layers, np.zeros(sizes[-1]), np.ones(sizes[-1])
    )

    text = network_text(network, tuple(comments))
    again = parse_network(text, "written")

    assert network_text(again, tuple(comments)) == text
    inputs = rng.normal(size=(3, sizes[0]))
    # six digits of the weights, each of which moves a sigmoid by at most a quarter of its change
    np.testing.assert_allclose(again.response(inputs), network.response(inputs), atol=1e-4)


BAD = {
    "empty file": ("", r"line 1: must begin with NNW"),
    "another file": ("SIMPLE  =  T", r"line 1: must begin with NNW \(got 'SIMPLE"),
    "no layers": ("NNW\n", r"line 1: the file ends before the number of layers"),
    "too many layers": ("NNW\n# c\n99 1", r"line 3: the number of layers must be 2\.\.10 \(got '99'\)"),
    "a word for a size": (
        "NNW\n3 ten 10 1",
        r"line 2: the number of neurons of layer 1 must be 1\.\.1000 \(got 'ten'\)",
    ),
    "a negative size": ("NNW\n3 -2 10 1", r"line 2: the number of neurons of layer 1"),
    "a word for a number": (
        SMALL.replace("0.25", "x25"),
        r"line 10: number 3 of 3 of the weights and biases of layer 3",
    ),
    "no number": (SMALL.replace("-1.0  #", "nan  #"), r"line 5: number 2 of 2 of the input biases must be a number"),
    "cut": (SMALL[: SMALL.index("0.25")], r"line 10: the file ends before number 3 of 3 of the weights and biases"),
    "too long": (SMALL + "7\n", r"line 13: must end after the output slopes \(got '7'\)"),
    "a number that would overflow": (SMALL.replace("-1.0  #", "-1e31  #"), r"must be a number within ±1e\+30"),
    "an output slope of 0": (SMALL.removesuffix(" 2.0\n") + " 0.0\n", r"must not be 0"),
}


@pytest.mark.parametrize("case", BAD, ids=lambda name: name.replace(" ", "_"))
def test_a_bad_file_is_refused_with_file_line_and_cause(case: str, tmp_path: Path) -> None:
    text, cause = BAD[case]
    path = tmp_path / "bad.nnw"
    path.write_text(text)

    with pytest.raises(BadInput, match=cause) as caught:
        read_network(path)

    assert str(caught.value).startswith(f"{path}: line ")
    assert "\n" not in str(caught.value)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.nnw")
    (tmp_path / "big.nnw").write_bytes(b"NNW\n" + b"0 " * 600_000)
    for path in (tmp_path, tmp_path / "none.nnw", tmp_path / "pipe.nnw", tmp_path / "big.nnw", tmp_path / ("x" * 300)):
        with pytest.raises(BadInput):
            read_network(path)


def test_an_edited_file_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "own.nnw"
    path.write_text(SMALL)
    before = read_network(path).response(np.zeros((1, 2)))
    path.write_text(SMALL.replace("0.25", "1.25"))

    assert read_network(path).response(np.zeros((1, 2))) != before
