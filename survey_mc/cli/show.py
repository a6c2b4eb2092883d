"""The verb show: what there is to choose from."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Literal, get_args, get_origin

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


def _parameters(model: Any) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "default": "required" if info.is_required() else info.get_default(call_default_factory=True),
            "allowed": _allowed(info),
            "about": info.description or "",
        }
        for name, info in model.model_fields.items()
    ]


def _allowed(info: Any) -> str:
    """What a parameter may be: its words, or its range."""
    if get_origin(info.annotation) is Literal:
        return " | ".join(str(word) for word in get_args(info.annotation))
    signs = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}
    limits = ((sign, getattr(limit, name, None)) for limit in info.metadata for name, sign in signs.items())
    return ", ".join(f"{sign} {value:g}" for sign, value in limits if isinstance(value, int | float))


def _parameter_lines(model: Any) -> list[str]:
    return [
        f"{p['name']} = {p['default'] if p['default'] == 'required' else repr(p['default'])}"
        f"{' (' + p['allowed'] + ')' if p['allowed'] else ''}   {p['about']}"
        for p in _parameters(model)
    ]


def _methods() -> dict[str, Any]:
    from survey_mc.detect import DETECTORS

    for problem in DETECTORS.refused.values():
        click.echo(f"warning: {problem}", err=True)
    return {d.name: _method(d, DETECTORS.origin(d.name)) for d in DETECTORS}


def _method(d: Any, package: str) -> dict[str, Any]:
    """A procedure as lines for people and as fields for machines."""
    profiles = {name: params.model_dump(mode="json") for name, params in d.profiles.items()}
    changed = {name: _changes(d.profiles.get("paper"), params) for name, params in d.profiles.items()}
    return {
        "about": f"{d.label}, version {d.version}: {d.about}",
        "lines": [
            f"reference: {d.reference}",
            *([f"package: {package}"] if package else []),
            *(f"profile {name}{': ' if changed[name] else ''}{changed[name]}" for name in profiles),
            *_parameter_lines(d.params),
            *(f"flags {bit}: {meaning}" for bit, meaning in d.flag_bits.items()),
            *(f"extended: {_cut(statistic)}" for statistic in d.extent_statistics),
        ],
        "label": d.label,
        "version": d.version,
        "reference": d.reference,
        "package": package,
        "profiles": profiles,
        "parameters": _parameters(d.params),
        "flags": {str(bit): meaning for bit, meaning in d.flag_bits.items()},
        "native_names": dict(d.native_names),
        "extent_statistics": [asdict(statistic) for statistic in d.extent_statistics],
    }


def _cut(statistic: Any) -> str:
    sign = "≥" if statistic.larger_is_extended else "<"
    return f"{statistic.column} {sign} {statistic.cut:g} {statistic.unit}".rstrip() + f"   {statistic.about}"


def _changes(paper: Any, params: Any) -> str:
    """The parameters of a profile that are not those of "paper"."""
    if paper is params:
        return ""
    before = paper.model_dump() if paper is not None else {}
    return ", ".join(f"{name} = {value!r}" for name, value in params.model_dump().items() if before.get(name) != value)


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
    from survey_mc.columns import DETECTIONS, LINKS, MATCHES, SKY_COLUMNS_OF_CATALOGUE, TRUTH
    from survey_mc.detect import DETECTORS, native_columns
    from survey_mc.report import REPORT_TABLES

    tables = {t.name: (t.about, t.columns) for t in (TRUTH, DETECTIONS, MATCHES, LINKS, *REPORT_TABLES)}
    tables["detections in a FITS catalogue, further columns"] = ("sky and FITS pixels", SKY_COLUMNS_OF_CATALOGUE)
    for d in DETECTORS:
        tables[f"detections of {d.name}, further columns"] = (d.label, d.extra_columns)
        if d.native_names:
            native = tuple(column for column, _ in native_columns(d))
            tables[f"detections of {d.name} in a FITS catalogue, further names"] = (d.label, native)
    return {
        name: {
            "about": about,
            "lines": [f"{c.name} ({c.dtype}{', ' + c.unit if c.unit else ''}): {c.about}" for c in columns],
            "columns": [asdict(c) for c in columns],
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
