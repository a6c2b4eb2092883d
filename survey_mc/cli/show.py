"""The verb show: what there is to choose from."""

from __future__ import annotations

from typing import Any

import click

from survey_mc.cli.options import json_option, print_json

TOPICS = ("methods", "instruments", "skies", "relations", "columns", "schema")


@click.command()
@click.argument("topic", type=click.Choice(TOPICS))
@json_option
def show(topic: str, as_json: bool) -> None:
    """List methods, instruments, skies, logN-logS relations, table columns, or the JSON Schema of a campaign file."""
    content = _CONTENT[topic]()
    if as_json or topic == "schema":
        print_json(content)
        return
    for name, entry in content.items():
        click.echo(f"{name}: {entry['about']}")
        for line in entry["lines"]:
            click.echo(f"    {line}")


def _parameter_lines(model: Any) -> list[str]:
    lines = []
    for name, info in model.model_fields.items():
        default = "required" if info.is_required() else repr(info.get_default(call_default_factory=True))
        lines.append(f"{name} = {default}   {info.description or ''}")
    return lines


def _methods() -> dict[str, Any]:
    from survey_mc.detect import DETECTORS

    return {
        d.name: {
            "about": f"{d.label}, version {d.version}: {d.about}",
            "lines": [
                f"reference: {d.reference}",
                f"profiles: {', '.join(d.profiles)}",
                *_parameter_lines(d.params),
                *(f"flags {bit}: {meaning}" for bit, meaning in d.flag_bits.items()),
            ],
        }
        for d in DETECTORS
    }


def _instruments() -> dict[str, Any]:
    from dataclasses import fields

    from survey_mc.telescope import INSTRUMENTS

    return {
        i.name: {
            "about": i.about,
            "lines": [f"{f.name} = {getattr(i, f.name)}" for f in fields(i) if f.name not in ("name", "about")],
        }
        for i in INSTRUMENTS
    }


def _skies() -> dict[str, Any]:
    from survey_mc.sky import SKIES

    return {s.name: {"about": s.about, "lines": _parameter_lines(s.params)} for s in SKIES}


def _relations() -> dict[str, Any]:
    from survey_mc.sky import RELATIONS

    return {r.name: {"about": r.about, "lines": []} for r in RELATIONS}


def _columns() -> dict[str, Any]:
    from survey_mc.columns import DETECTIONS, LINKS, MATCHES, TRUTH
    from survey_mc.detect import DETECTORS
    from survey_mc.report import REPORT_TABLES

    tables = {t.name: (t.about, t.columns) for t in (TRUTH, DETECTIONS, MATCHES, LINKS, *REPORT_TABLES)}
    for d in DETECTORS:
        tables[f"detections of {d.name}, further columns"] = (d.label, d.extra_columns)
    return {
        name: {
            "about": about,
            "lines": [f"{c.name} ({c.dtype}{', ' + c.unit if c.unit else ''}): {c.about}" for c in columns],
        }
        for name, (about, columns) in tables.items()
    }


def _schema() -> dict[str, Any]:
    from survey_mc.campaign import json_schema

    return json_schema()


_CONTENT = {
    "methods": _methods,
    "instruments": _instruments,
    "skies": _skies,
    "relations": _relations,
    "columns": _columns,
    "schema": _schema,
}
