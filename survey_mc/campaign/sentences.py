"""Validation errors as one sentence: place, what is wrong, what was found, what is allowed."""

from __future__ import annotations

from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from survey_mc.campaign.quantities import shown_key
from survey_mc.campaign.schema import NAME_PATTERN, ONE_LINE_PATTERN
from survey_mc.detect import DETECTORS
from survey_mc.registry import UnknownName, nearest_name

_NOT_SHOWN = object()


def sentence_of(error: ValidationError, model: type[BaseModel], content: dict[str, Any]) -> str:
    """The first error of a validation as "place: problem (got value)", and how many more there are."""
    errors = _causes(error)
    first = errors[0]
    place, value = _place(first["loc"], content)
    if first["type"] in ("union_tag_not_found", "union_tag_invalid"):
        place, text = f"{place}.kind" if place else "kind", _unknown_kind(first)
    elif first["type"] == "extra_forbidden":
        text = _unknown_key(first["loc"], model, content)
    elif first["type"] == "missing":
        text = "is missing"
    else:
        message = _plain(first["msg"])
        shown = value if value is not _NOT_SHOWN else first.get("input")
        known = first["type"] == "value_error" and repr(shown) in message
        text = _lower_first(message) + (
            "" if known or isinstance(shown, (dict, BaseModel)) else f" (got {_short(shown)})"
        )
    more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    return f"{place}: {text}{more}" if place else f"{text}{more}"


def _causes(error: ValidationError) -> list[ErrorDetails]:
    """The errors without those that only follow from one inside them, such as a list that lost its bad value.

    Unknown keys come first: a misspelt key also leaves one missing, and it is the one to mend.
    """
    errors = error.errors(include_url=False)
    above = {e["loc"][:depth] for e in errors for depth in range(len(e["loc"]))}
    return sorted((e for e in errors if e["loc"] not in above), key=lambda e: e["type"] != "extra_forbidden")


def _plain(message: str) -> str:
    """A message of the validation in the words of a campaign file."""
    message = message.removeprefix("Value error, ").removeprefix("Assertion failed, ")
    for theirs, ours in (
        ("Input should be ", "must be "),
        ("String should ", "must "),
        ("Tuple should ", "must "),
        ("an object", "a table"),
        ("a valid object", "a table"),
        ("a valid array", "a list"),
        (f"match pattern '{NAME_PATTERN}'", "be 1..100 letters, digits, _ - and ., the first a letter or a digit"),
        (f"match pattern '{ONE_LINE_PATTERN}'", "be one line without control characters"),
    ):
        message = message.replace(theirs, ours)
    return message


def _unknown_kind(error: ErrorDetails) -> str:
    if error["type"] == "union_tag_not_found":
        return "is missing; see `survey-mc show skies`"
    context = error["ctx"]
    known = [name.strip(" '") for name in str(context["expected_tags"]).split(",")]
    return str(UnknownName("kind", str(context["tag"])[:80], known))


def _place(loc: tuple[int | str, ...], content: Any) -> tuple[str, Any]:
    """The place as a TOML path, leaving out the union tags that validation puts between the keys, and its value."""
    text = ""
    here: Any = content
    for step in loc:
        if isinstance(here, dict) and step in here:
            here = here[step]
        elif isinstance(here, list) and isinstance(step, int) and step < len(here):
            here = here[step]
        elif isinstance(step, str) and not (isinstance(here, dict) and step is loc[-1]):
            continue  # a union tag, such as the kind of the sky
        else:
            here = _NOT_SHOWN
        text += f"[{step}]" if isinstance(step, int) else f".{shown_key(step)}" if text else shown_key(step)
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
