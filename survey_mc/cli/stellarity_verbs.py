"""The verb that trains the network of the stellarity index: train-stellarity."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from survey_mc.cli.options import PATH, executor_options, refuse_overwriting

if TYPE_CHECKING:
    from survey_mc.run import FieldLimits
    from survey_mc.run.executors import ExecutorChoice

DEFAULT_CAMPAIGN = Path("campaigns/classification_training.toml")


@click.command("train-stellarity")
@click.argument("campaign", type=PATH, metavar="[CAMPAIGN.toml]", default=DEFAULT_CAMPAIGN)
@click.option("--out", type=PATH, required=True, metavar="FILE.nnw", help="Network to write, in SExtractor's format.")
@click.option("--run", type=PATH, metavar="DIR", help="Run directory of the campaign.  [default: results/<name>]")
@click.option(
    "--epochs",
    type=click.IntRange(1, 100_000),
    default=2000,
    show_default=True,
    metavar="N",
    help="Most steps of the fit, each over all sources; it ends earlier when validation gets no better.",
)
@click.option("--seed", type=int, default=0, show_default=True, metavar="S", help="Seed of the fit's random start.")
@click.option("--overwrite", is_flag=True, help="Replace the file if it exists.")
@executor_options
def train_stellarity(
    campaign: Path,
    out: Path,
    run: Path | None,
    epochs: int,
    seed: int,
    overwrite: bool,
    executor: ExecutorChoice,
    limits: FieldLimits,
) -> None:
    """Train the network of the stellarity index on simulated points and clusters.

    Runs the campaign (default campaigns/classification_training.toml), or what is missing of it, and fits. The same
    campaign, seed and libraries give the same file. Use it with `stellarity_network = "FILE.nnw"` among the
    parameters of gauss_se and mr1_se.
    """
    from survey_mc.campaign import load_campaign
    from survey_mc.cli.progress import show_progress
    from survey_mc.fits.writing import check_target
    from survey_mc.train import train_stellarity as train

    refuse_overwriting((out,), (campaign,))
    check_target(out, overwrite)
    loaded = load_campaign(campaign)
    with show_progress(loaded.name) as on_progress:
        trained = train(
            loaded,
            run,
            executor,
            limits=limits,
            max_steps=epochs,
            seed=seed,
            on_progress=on_progress,
            say=lambda line: click.echo(line, err=True),
        )
    out.write_text(trained.text, encoding="ascii")
    for group, result in trained.separations.items():
        click.echo(f"  {group}: {result}")
    click.echo(f"{out}: a network of {'-'.join(str(n) for n in trained.network.sizes)} neurons")


STELLARITY_VERBS = (train_stellarity,)
