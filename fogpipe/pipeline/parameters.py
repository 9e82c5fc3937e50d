"""The parameters of one stage: settled by its model, and what is wrong with them in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from fogpipe.errors import suggestion
from fogpipe.pipeline.cards import type_text
from fogpipe.stage import Contract

_OF_FORM = frozenset({"missing", "too_short", "too_long", "tuple_type", "list_type"})
"""What pydantic calls a value of another form, which is best told by the form that is wanted."""


@dataclass(frozen=True)
class Fault:
    """Something wrong with what a stage is given.

    Attributes
    ----------
    parameters : those that it lies in; several where values do not go together, none where one is missing.
    what : what is wrong, and what to do.
    """

    parameters: tuple[str, ...]
    what: str


def settled(contract: Contract, given: Mapping[str, Any]) -> tuple[dict[str, Any], list[Fault]]:
    """Every parameter of a stage with its validated value, or the faults of those that are given."""
    try:
        model = contract.model.model_validate(given)
    except ValidationError as error:
        return {}, list(_faults(contract, given, error.errors()))
    return {name: getattr(model, name) for name in contract.model.model_fields}, []


def _faults(contract: Contract, given: Mapping[str, Any], errors: list[Any]) -> Iterator[Fault]:
    by_parameter: dict[str, list[Any]] = {}
    for error in errors:
        by_parameter.setdefault(str(next(iter(error["loc"]), "")), []).append(error)
    for name, found in by_parameter.items():
        first = found[0]
        if not name:
            yield Fault(contract.required_arguments, str(first["ctx"]["error"]))
        elif first["type"] == "extra_forbidden":
            hint = suggestion(name, contract.model.model_fields)
            yield Fault((name,), f"is not a parameter of {contract.name}.{hint}")
        elif first["type"] == "missing" and len(first["loc"]) == 1:
            yield Fault((), f"{contract.name} needs the parameter {name} under 'with'.")
        elif len(found) > 1 or first["type"] in _OF_FORM:
            wanted = next(type_text(parameter) for parameter in contract.parameters if parameter.name == name)
            yield Fault((name,), f"should be {wanted}, not {given[name]!r}.")
        else:
            yield Fault((name,), f"{first['msg'].replace('Input should', 'should')}, not {first['input']!r}.")
