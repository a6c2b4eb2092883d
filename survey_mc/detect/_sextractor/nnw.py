"""Neural networks in SExtractor's text format, `.nnw`: read, written, evaluated.

Idea     after the word NNW come numbers, separated by white space of any kind, with comments after "#": the number of
         layers and the neurons of each, a bias and a slope for every input, then for every neuron of the next layers
         its weights and its bias, at last a bias and a slope for every output. A neuron is 1 / (1 + exp(−Σ w·n − b)).
Source   Bertin & Arnouts 1996 A&AS 117, 393, Sect. 8; SExtractor User's Guide (parameter STARNNW_NAME).
Limits   networks without connections that skip a layer; at most 10 layers of 1000 neurons.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from survey_mc.caches import bounded_cache
from survey_mc.errors import BadInput
from survey_mc.types import FloatArray

MAGIC = "NNW"
MAX_BYTES = 1_000_000
MAX_LAYERS = 10
MAX_NEURONS = 1000  # in one layer
LARGEST_NUMBER = 1e30  # in a file; sums of products of these do not overflow
LARGEST_ARGUMENT = 500.0  # of the exponential; beyond it the neuron is 0 or 1 to the last digit


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """A feed-forward network.

    input_bias, input_slope: (n_inputs,): neuron = input · slope + bias. layers: for each next layer its weights
    (n, n_before) and biases (n,). output_bias, output_slope: (n_outputs,): output = (neuron − bias) / slope.
    """

    input_bias: FloatArray
    input_slope: FloatArray
    layers: tuple[tuple[FloatArray, FloatArray], ...]
    output_bias: FloatArray
    output_slope: FloatArray

    @property
    def sizes(self) -> tuple[int, ...]:
        """Neurons of each layer, the inputs first."""
        return (len(self.input_bias), *(len(bias) for _, bias in self.layers))

    def response(self, inputs: FloatArray) -> FloatArray:
        """Outputs (n, n_outputs) for inputs (n, n_inputs). A row does not depend on the others."""
        neurons = np.asarray(inputs, dtype=np.float64) * self.input_slope + self.input_bias
        for weights, bias in self.layers:
            # Added up one by one: the sums of a matrix product depend on how many rows there are.
            total = np.tile(bias, (len(neurons), 1))
            for i in range(neurons.shape[1]):
                total += neurons[:, i, None] * weights[:, i]
            neurons = sigmoid(total)
        return np.asarray((neurons - self.output_bias) / self.output_slope)


def sigmoid(x: FloatArray) -> FloatArray:
    """1 / (1 + exp(−x)), without overflow."""
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(x, -LARGEST_ARGUMENT, LARGEST_ARGUMENT))))


def read_network(path: Path | str) -> Network:
    """The network of a `.nnw` file; `BadInput` with file, line and what is wrong."""
    path = Path(path)
    try:
        if not path.is_file():
            raise BadInput(str(path), "there is no such file; give a network in SExtractor's format (.nnw)")
        if path.stat().st_size > MAX_BYTES:
            raise BadInput(str(path), f"is too large for a network (at most {MAX_BYTES} bytes)")
        text = path.read_bytes().decode("latin-1")  # comments may be in any encoding; numbers are ASCII
    except (OSError, ValueError) as problem:
        raise BadInput(str(path)[:200], f"cannot be read: {getattr(problem, 'strerror', None) or problem}") from None
    return parse_network(text, str(path))


@bounded_cache(16)
def parse_network(text: str, where: str) -> Network:
    """The network of a text; `where` names it in errors."""
    lines = text.splitlines()
    if not lines or not lines[0].startswith(MAGIC):
        raise BadInput(f"{where}: line 1", f"must begin with {MAGIC} (got {(lines or [''])[0][:20]!r})")
    words = _Words(where, lines)
    n_layers = words.count("the number of layers", 2, MAX_LAYERS)
    sizes = [words.count(f"the number of neurons of layer {i + 1}", 1, MAX_NEURONS) for i in range(n_layers)]
    input_bias = words.numbers("input biases", sizes[0])
    input_slope = words.numbers("input slopes", sizes[0])
    layers = []
    for i, (before, after) in enumerate(pairwise(sizes)):
        table = words.numbers(f"weights and biases of layer {i + 2}", after * (before + 1)).reshape(after, before + 1)
        layers.append((np.ascontiguousarray(table[:, :-1]), np.ascontiguousarray(table[:, -1])))
    output_bias = words.numbers("output biases", sizes[-1])
    output_slope = words.numbers("output slopes", sizes[-1])
    if (np.abs(output_slope) < 1.0 / LARGEST_NUMBER).any():
        raise BadInput(f"{where}: line {words.line}", f"an output slope must not be 0 or below {1 / LARGEST_NUMBER:g}")
    words.end()
    return Network(input_bias, input_slope, tuple(layers), output_bias, output_slope)


class _Words:
    """The words of a file after its first line, each with its line."""

    def __init__(self, where: str, lines: list[str]) -> None:
        self.where, self.line, self.last = where, 1, len(lines)
        self._words: Iterator[tuple[int, str]] = (
            (number, word) for number, line in enumerate(lines[1:], start=2) for word in line.partition("#")[0].split()
        )

    def _next(self, noun: str) -> str:
        try:
            self.line, word = next(self._words)
        except StopIteration:
            raise BadInput(f"{self.where}: line {self.last}", f"the file ends before {noun}") from None
        return word

    def count(self, noun: str, least: int, most: int) -> int:
        word = self._next(noun)
        value = int(word) if word.isascii() and word.isdigit() and len(word) < 10 else -1
        if not least <= value <= most:
            raise BadInput(f"{self.where}: line {self.line}", f"{noun} must be {least}..{most} (got {word[:20]!r})")
        return value

    def numbers(self, noun: str, n: int) -> FloatArray:
        values = np.empty(n)
        for i in range(n):
            place = f"number {i + 1} of {n} of the {noun}"
            word = self._next(place)
            try:
                values[i] = float(word)
            except ValueError:
                values[i] = math.nan
            if not abs(values[i]) <= LARGEST_NUMBER:
                problem = f"{place} must be a number within ±{LARGEST_NUMBER:g} (got {word[:20]!r})"
                raise BadInput(f"{self.where}: line {self.line}", problem)
        values.setflags(write=False)
        return values

    def end(self) -> None:
        for line, word in self._words:
            raise BadInput(f"{self.where}: line {line}", f"must end after the output slopes (got {word[:20]!r})")


def network_text(network: Network, comments: tuple[str, ...] = ()) -> str:
    """A network as the text of a `.nnw` file, with five digits after the point; comments: one line each."""
    table_of = [np.column_stack([weights, bias]) for weights, bias in network.layers]
    blocks = [
        [f" {len(network.sizes)} {' '.join(str(n) for n in network.sizes)}"],
        [_row(network.input_bias), _row(network.input_slope)],
        *([_row(row) for row in table] for table in table_of),
        [_row(network.output_bias), _row(network.output_slope)],
    ]
    head = "\n".join([MAGIC, *(f"# {line}".rstrip() for line in comments)])
    return "\n\n".join([head, *("\n".join(block) for block in blocks)]) + "\n"


def _row(values: FloatArray) -> str:
    return " ".join(f"{value:12.5e}" for value in values)
