"""Validation errors as one sentence: place, what is wrong, what was found, what is allowed."""

from __future__ import annotations

from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from survey_mc.detect import DETECTORS
from survey_mc.registry import nearest_name

_NOT_SHOWN = object()


def sentence_of(error: ValidationError, model: type[BaseModel], content: dict[str, Any]) -> str:
    """The first error of a validation as "place: problem (got value)", and how many more there are."""
    errors = error.errors(include_url=False)
    first = errors[0]
    place, value = _place(first["loc"], content)
    if first["type"] == "extra_forbidden":
        text = _unknown_key(first["loc"], model, content)
    elif first["type"] == "missing":
        text = "is missing"
    else:
        message = first["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
        shown = value if value is not _NOT_SHOWN else first.get("input")
        known = first["type"] == "value_error" and repr(shown) in message
        text = _lower_first(message) + (
            "" if known or isinstance(shown, (dict, BaseModel)) else f" (got {_short(shown)})"
        )
    more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    return f"{place}: {text}{more}" if place else f"{text}{more}"


def _place(loc: tuple[int | str, ...], content: Any) -> tuple[str, Any]:
    """The place as a TOML path, leaving out the union tags that validation puts between the keys, and its value."""
    text = ""
    here: Any = content
    for step in loc:
        if isinstance(here, dict) and step in here:
            here = here[step]
        elif isinstance(here, list) and isinstance(step, int) and step < len(here):
            here = here[step]
        elif isinstance(here, dict) and step is not loc[-1] and isinstance(step, str):
            continue  # a union tag, such as the kind of the sky
        else:
            here = _NOT_SHOWN
        text += f"[{step}]" if isinstance(step, int) else (f".{step}" if text else str(step))
    return text, here


def _unknown_key(loc: tuple[int | str, ...], model: type[BaseModel], content: dict[str, Any]) -> str:
    allowed = _allowed_keys(loc[:-1], model, content)
    if not allowed:
        return "is not a known key"
    guess = nearest_name(str(loc[-1]), allowed)
    hint = f"; did you mean {guess!r}?" if guess else ""
    return f"is not a known key; allowed here: {', '.join(allowed)}{hint}"


def _allowed_keys(loc: tuple[int | str, ...], model: type[BaseModel], content: Any) -> list[str]:
    """Names of the fields of the model at a place, found by walking the annotations along the place."""
    here: Any = model
    if "method" in loc and "params" in loc:
        name = content["method"][loc[1]].get("name")
        return sorted(DETECTORS[name].params.model_fields) if name in DETECTORS else []
    for step in loc:
        models = _models_in(here)
        fields = {
            alias: info.annotation
            for m in models
            for name, info in m.model_fields.items()
            for alias in {name, info.alias or name}
        }
        if step in fields:
            here = fields[step]
        elif isinstance(step, str):
            here = next((m for m in models if _tag(m) == step), here)
    models = _models_in(here)
    return sorted({info.alias or name for m in models for name, info in m.model_fields.items()})


def _tag(model: type[BaseModel]) -> Any:
    kind = model.model_fields.get("kind")
    return kind.default if kind is not None else None


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for part in get_args(annotation) for m in _models_in(part)]


def _lower_first(text: str) -> str:
    return text[:1].lower() + text[1:]


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
