"""Train the network of the stellarity index on a campaign of points and clusters.

Idea     run the campaign, take the detections whose origin is sure, fit the network of SExtractor's shape (10-10-1),
         write it in SExtractor's format with a head that says what it was made of and how good it is.
Source   Bertin & Arnouts 1996 A&AS 117, 393, Sect. 8, where optical images were simulated; paper Sect. 3.5.
Limits   no date, host or path is written: the same campaign, seed and libraries give the same file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from survey_mc.campaign import Campaign, expand
from survey_mc.detect import DETECTORS
from survey_mc.detect.stellarity import Network, network_text
from survey_mc.errors import BadInput
from survey_mc.rng import stream
from survey_mc.run import FieldLimits, Progress, run_campaign
from survey_mc.run.engine import default_run_dir
from survey_mc.run.executors import ExecutorChoice
from survey_mc.store import RunData
from survey_mc.train.examples import Examples, gather_examples, refuse_without_stellarity, split_by_field, thinned
from survey_mc.train.perceptron import Fitted, Labelled, fit_perceptron
from survey_mc.train.separation import Separation, separation

N_HIDDEN = 10  # SExtractor's
MOST_OF_A_KIND = 8000  # training sources of one kind in one group; more points than that teach nothing new
LEAST_OF_A_KIND = 20  # in training and in validation
DEFAULT_STEPS = 2000
STEPS_BETWEEN_LINES = 50


@dataclass(frozen=True, slots=True)
class TrainedNetwork:
    """A network, its file's text, and how it separates the validation sources of every group."""

    network: Network
    text: str
    separations: dict[str, Separation]


def train_stellarity(
    campaign: Campaign,
    run_dir: Path | None = None,
    executor: ExecutorChoice | None = None,
    *,
    limits: FieldLimits | None = None,
    max_steps: int = DEFAULT_STEPS,
    seed: int = 0,
    on_progress: Callable[[Progress], None] = lambda state: None,
    say: Callable[[str], None] = lambda line: None,
) -> TrainedNetwork:
    """Run what is missing of the campaign and train a network on its sources.

    run_dir: default results/<name>. max_steps: most steps of the fit. seed: of its random start. say: gets one line now
    and then. Raises `BadInput` if the campaign has failures or too few sources of a kind.
    """
    refuse_without_stellarity(campaign)
    root = run_dir if run_dir is not None else default_run_dir(campaign)
    summary = run_campaign(campaign, root, executor, limits=limits, on_progress=on_progress)
    if not summary.complete:
        raise BadInput(
            str(root), f"has failures, and a network is trained on whole runs; see `survey-mc status {root}`"
        )
    examples = gather_examples(campaign, RunData(root))
    training, validation = split_by_field(examples)
    for noun, part in (("training", training), ("validation", validation)):
        n_points = int(part.is_point.sum())
        say(f"{noun}: {n_points} points, {len(part) - n_points} extended sources")
        if min(n_points, len(part) - n_points) < LEAST_OF_A_KIND:
            raise BadInput(campaign.name, f"gives fewer than {LEAST_OF_A_KIND} {noun} sources of a kind: more fields")
    training = thinned(training, MOST_OF_A_KIND, stream(f"train-stellarity/{seed}", "examples"))
    fitted = fit_network(training, validation, max_steps, seed, say)
    found = separations(fitted.network, validation)
    head = (*_facts(campaign, training, validation, fitted, max_steps, seed), *_results(found))
    return TrainedNetwork(fitted.network, network_text(fitted.network, head), found)


def fit_network(
    training: Examples, validation: Examples, max_steps: int, seed: int, say: Callable[[str], None]
) -> Fitted:
    """The network that tells the kinds apart, groups and kinds weighing the same."""
    learn, judge = (Labelled(part.inputs, part.is_point, part.weights()) for part in (training, validation))

    def on_step(step: int, loss: float) -> None:
        if step % STEPS_BETWEEN_LINES == 0:
            say(f"step {step}: validation loss {loss:.5f}")

    rng = stream(f"train-stellarity/{seed}", "start")
    return fit_perceptron(learn, judge, N_HIDDEN, max_steps, rng, on_step)


def separations(network: Network, examples: Examples) -> dict[str, Separation]:
    """How a network separates the sources of each group."""
    score = network.response(examples.inputs)[:, 0]
    return {
        name: separation(score[examples.group == number], examples.is_point[examples.group == number])
        for number, name in enumerate(examples.groups)
    }


def _facts(
    campaign: Campaign, training: Examples, validation: Examples, fitted: Fitted, max_steps: int, seed: int
) -> Iterator[str]:
    yield "Stellarity of X-ray sources: 0 extended, 1 point. Made by `survey-mc train-stellarity`."
    yield "Inputs: log10 of ISO0/f^2, peak/threshold, ISO1/f^2 ... ISO7/f^2, seeing FWHM (arcsec); f: that in pixels."
    cells = ", ".join(cell.label for cell in expand(campaign))
    yield f"campaign {campaign.name}, seed {campaign.seed}, {campaign.grid.realisations} realisations of {cells}"
    for name in dict.fromkeys(choice.name for choice in campaign.method):
        yield f"procedure {name} version {DETECTORS[name].version}"
    for noun, part in (("training", training), ("validation", validation)):
        yield f"{noun} on {int(part.is_point.sum())} points and {int((~part.is_point).sum())} extended sources"
    yield f"seed of the fit {seed}, best of {fitted.steps} steps (at most {max_steps}): {fitted.best_step}"


def _results(found: dict[str, Separation]) -> Iterator[str]:
    yield "validation:"
    for name, result in found.items():
        # SExtractor reads ASCII.
        text = f"  {name}: {result}".replace("±", "+-").replace("″", " arcsec")
        yield text.encode("ascii", "replace").decode()
