"""A perceptron of one hidden layer, fitted to two classes.

Idea     least weighted cross entropy, by L-BFGS from a random start on inputs of mean 0 and scatter 1; of all steps the
         one that is best on the validation set is kept (early stopping).
Source   Rumelhart, Hinton & Williams 1986 Nature 323, 533; Nocedal 1980 Math. Comp. 35, 773.
Limits   sums over sources are taken in a fixed order, not by a threaded library: the same data give the same network on
         one kind of machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from survey_mc.detect.stellarity import Network, sigmoid
from survey_mc.types import BoolArray, FloatArray

PATIENCE = 60  # steps without a better validation before the fit ends
LEAST_GAIN = 1e-6  # of the validation loss (nats), to count as better
PENALTY = 1e-7  # on the sum of the squared weights, which would grow for ever where classes do not overlap
LEAST_SCATTER = 1e-6  # of an input; a constant one is not scaled
LARGEST_LOGIT = 30.0  # beyond it a wrong answer costs no more

OnStep = Callable[[int, float], None]


@dataclass(frozen=True, slots=True)
class Labelled:
    """inputs: (n, n_inputs); is_point: (n,); weight: (n,), sum 1."""

    inputs: FloatArray
    is_point: BoolArray
    weight: FloatArray


@dataclass(frozen=True, slots=True)
class Fitted:
    """The best network, the step it was met at and how many were tried; loss: its validation loss, nats a source."""

    network: Network
    best_step: int
    steps: int
    loss: float


@dataclass(frozen=True, slots=True)
class Weights:
    """hidden: (n_hidden, n_inputs + 1) and output: (1, n_hidden + 1), the bias of each neuron last."""

    hidden: FloatArray
    output: FloatArray

    @classmethod
    def unpacked(cls, vector: FloatArray, n_inputs: int, n_hidden: int) -> Weights:
        n = n_hidden * (n_inputs + 1)
        return cls(vector[:n].reshape(n_hidden, n_inputs + 1), vector[n:].reshape(1, n_hidden + 1))


def fit_perceptron(
    training: Labelled,
    validation: Labelled,
    n_hidden: int,
    max_steps: int,
    rng: np.random.Generator,
    on_step: OnStep = lambda step, loss: None,
) -> Fitted:
    """Fit a network of `n_hidden` hidden neurons; on_step is given every step and its validation loss."""
    bias, slope = input_scaling(training)
    n_inputs = len(slope)
    x, x_validation = training.inputs * slope + bias, validation.inputs * slope + bias
    first = rng.normal(0.0, 1.0 / np.sqrt(n_inputs), n_hidden * (n_inputs + 1))
    best = np.concatenate([first, rng.normal(0.0, 1.0 / np.sqrt(n_hidden), n_hidden + 1)])
    best_loss, best_step, step = np.inf, 0, 0

    def cost(vector: FloatArray) -> tuple[float, FloatArray]:
        weights = Weights.unpacked(vector, n_inputs, n_hidden)
        loss, gradient = loss_and_gradient(weights, x, training.is_point, training.weight)
        return loss + PENALTY * float(np.square(vector).sum()), gradient + 2.0 * PENALTY * vector

    def after_step(vector: FloatArray) -> None:
        nonlocal best, best_loss, best_step, step
        step += 1
        _, logit = forward(Weights.unpacked(vector, n_inputs, n_hidden), x_validation)
        loss = cross_entropy(logit, validation.is_point, validation.weight)
        on_step(step, loss)
        if loss < best_loss - LEAST_GAIN:
            best, best_loss, best_step = vector.copy(), loss, step
        if step - best_step >= PATIENCE:
            raise StopIteration

    options = {"maxiter": max_steps, "maxfun": 10 * max_steps, "maxcor": 20, "ftol": 0.0, "gtol": 0.0}
    minimize(cost, best, jac=True, method="L-BFGS-B", callback=after_step, options=options)
    return Fitted(as_network(Weights.unpacked(best, n_inputs, n_hidden), bias, slope), best_step, step, best_loss)


def input_scaling(training: Labelled) -> tuple[FloatArray, FloatArray]:
    """Bias and slope of each input: input · slope + bias has the mean 0 and the scatter 1."""
    mean = np.einsum("n,ni->i", training.weight, training.inputs)
    scatter = np.sqrt(np.einsum("n,ni->i", training.weight, np.square(training.inputs - mean)))
    slope = np.where(scatter > LEAST_SCATTER, 1.0 / np.maximum(scatter, LEAST_SCATTER), 1.0)
    return -mean * slope, slope


def forward(weights: Weights, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Hidden neurons (n, n_hidden) and logit of the output (n,)."""
    hidden = sigmoid(np.einsum("ni,ji->nj", x, weights.hidden[:, :-1]) + weights.hidden[:, -1])
    return hidden, np.einsum("nj,j->n", hidden, weights.output[0, :-1]) + weights.output[0, -1]


def cross_entropy(logit: FloatArray, is_point: BoolArray, weight: FloatArray) -> float:
    """Weighted mean of −ln(probability given to the truth), nats."""
    right = np.clip(np.where(is_point, logit, -logit), -LARGEST_LOGIT, LARGEST_LOGIT)
    return float(np.sum(weight * np.log1p(np.exp(-right))))


def loss_and_gradient(
    weights: Weights, x: FloatArray, is_point: BoolArray, weight: FloatArray
) -> tuple[float, FloatArray]:
    """Cross entropy, and its derivatives in the order of `Weights.unpacked`."""
    hidden, logit = forward(weights, x)
    error = weight * (sigmoid(logit) - is_point)
    back = error[:, None] * weights.output[0, :-1] * hidden * (1.0 - hidden)
    gradient = (
        np.column_stack([np.einsum("nj,ni->ji", back, x), back.sum(axis=0)]),
        np.append(np.einsum("n,nj->j", error, hidden), error.sum()),
    )
    return cross_entropy(logit, is_point, weight), np.concatenate([part.ravel() for part in gradient])


def as_network(weights: Weights, bias: FloatArray, slope: FloatArray) -> Network:
    """The network with these weights, whose output is the probability of a point."""
    layers = tuple((layer[:, :-1], layer[:, -1]) for layer in (weights.hidden, weights.output))
    return Network(bias, slope, layers, np.zeros(1), np.ones(1))
