"""The verb for authors of procedures: check-detector."""

from __future__ import annotations

import click

from survey_mc.cli.options import json_option, print_json
from survey_mc.errors import EXIT_BAD_INPUT


@click.command("check-detector")
@click.argument("name", metavar="NAME")
@click.option("--profile", default="paper", show_default=True, metavar="NAME", help="Named set of parameters to try.")
@click.option("--claim", "names", multiple=True, metavar="NAME", help="Try this claim only; may be repeated.")
@click.option("--seed", type=int, default=0, show_default=True, metavar="N", help="Seed of the fields.")
@click.option("--granted", is_flag=True, help="Give the background map with the fields, for procedures that need one.")
@json_option
def check_detector(name: str, profile: str, names: tuple[str, ...], seed: int, granted: bool, as_json: bool) -> int:
    """Try the conformance claims on a registered procedure, built-in or of an installed package.

    Prints one line a claim; leaves with 0 if none is broken, with 2 otherwise.
    """
    from survey_mc.detect import DETECTORS
    from survey_mc.registry import UnknownName
    from survey_mc.testing import claims, conformance_of

    detector = DETECTORS[name]
    if profile not in detector.profiles:
        raise UnknownName(f"profile of {name}", profile, detector.profiles)
    found = conformance_of(
        detector, detector.profiles[profile], claims=claims(*names), seed=seed, grants_background=granted
    )
    if as_json:
        verdicts = [
            {
                "claim": verdict.claim.name,
                "about": verdict.claim.about,
                "status": verdict.status,
                "sentence": verdict.sentence,
                "seconds": round(verdict.seconds, 3),
            }
            for verdict in found.verdicts
        ]
        print_json({"detector": name, "version": detector.version, "sound": found.sound, "claims": verdicts})
    else:
        for verdict in found.verdicts:
            click.echo(f"{verdict.status:<15}{verdict.claim.name}{': ' * bool(verdict.sentence)}{verdict.sentence}")
        number = len(found.verdicts)
        outcome = "no claim is broken" if found.sound else f"{len(found.broken)} claims are broken"
        click.echo(f"{detector.label} (version {detector.version}, profile {profile}): {outcome} of {number}")
    return 0 if found.sound else EXIT_BAD_INPUT
