"""The signature is the whole declaration."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
import pytest
from annotated_types import Ge
from pydantic import ValidationError

from fogpipe.errors import ContractError
from fogpipe.ports import Density, Image, Mask, Range, Transmission, Unit
from fogpipe.stage import contract, is_stage, stage, unit_of


@stage("test.good", version=3)
def good(
    range_map: Range,
    density: Density | None = None,
    *,
    rng: np.random.Generator,
    extinction: Annotated[float, Ge(0), Unit("1/m")] = 0.02,
) -> Transmission:
    """Summary line.

    More.
    """
    return np.exp(-extinction * range_map)


def test_the_decorated_function_is_the_function_that_was_written():
    assert is_stage(good)
    assert good(np.zeros((1, 1)), rng=np.random.default_rng(0)) == 1


def test_positional_arguments_are_ports_and_keyword_only_ones_parameters():
    found = contract(good)
    assert [(p.name, p.kind.name, p.optional) for p in found.inputs] == [
        ("range_map", "Range", False),
        ("density", "Density", True),
    ]
    assert [p.name for p in found.parameters] == ["extinction"]
    assert found.injected == {"rng"}
    assert [(p.name, p.kind.name) for p in found.outputs] == [("", "Transmission")]
    assert (found.name, found.mark.version, found.summary) == ("test.good", 3, "Summary line.")


def test_the_parameter_model_has_defaults_bounds_and_refuses_strangers():
    model = contract(good).model
    assert model().extinction == 0.02  # type: ignore[attr-defined]
    with pytest.raises(ValidationError):
        model(extinction=-1)
    with pytest.raises(ValidationError):
        model(extinctoin=1)


def test_a_parameter_has_a_unit():
    assert unit_of(contract(good).parameters[0].annotation) == "1/m"
    assert unit_of(Annotated[float, Unit("m")] | None) == "m"
    assert unit_of(float) is unit_of(float | None) is None


def test_parameters_that_do_not_go_together_are_refused_by_the_model():
    def one(near: float | None, far: float | None) -> None:
        if near is not None and far is not None:
            raise ValueError("give near or far.")

    @stage("test.either", requires=one)
    def either(range_map: Range, *, near: float | None = None, far: float | None = None) -> Range:
        one(near, far)
        return range_map

    assert contract(either).required_arguments == ("near", "far")
    assert contract(either).model(near=1).near == 1  # type: ignore[attr-defined]
    with pytest.raises(ValidationError, match=r"give near or far\."):
        contract(either).model(near=1, far=2)


def test_a_requirement_may_only_ask_for_parameters_of_the_stage():
    def wrong(range_map: Range, *, near: float = 0) -> Range: ...

    with pytest.raises(ContractError, match="requires asks for range_map"):
        contract(stage("test.wrong", requires=lambda range_map: None)(wrong))


def test_a_named_tuple_gives_several_outputs():
    class Pair(NamedTuple):
        near: Mask
        far: Mask

    def pair(range_map: Range) -> Pair:
        return Pair(range_map < 1, range_map >= 1)

    pair.__annotations__["return"] = Pair  # a local class has no name that a string could be resolved by
    assert [p.name for p in contract(stage("test.pair")(pair)).outputs] == ["near", "far"]


def _no_kind(x: float) -> Image: ...
def _no_annotation(x) -> Image: ...  # type: ignore[no-untyped-def]
def _no_return(x: Image): ...  # type: ignore[no-untyped-def]
def _variadic(*x: Image) -> Image: ...
def _returns_number(x: Image) -> float: ...
def _default_without_none(x: Image = None) -> Image: ...  # type: ignore[assignment]
def _unknown_type(x: Imagge) -> Image: ...  # type: ignore[name-defined]  # noqa: F821


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (_no_kind, "no kind"),
        (_no_annotation, "no annotation"),
        (_no_return, "return annotation"),
        (_variadic, "not possible"),
        (_returns_number, "return annotation"),
        (_default_without_none, "optional port"),
        (_unknown_type, "Imagge"),
    ],
)
def test_a_wrong_signature_is_refused_with_the_reason(function, message: str):
    with pytest.raises(ContractError, match=message):
        contract(stage("test.wrong")(function))


def test_identity_needs_an_output_of_the_kind_of_the_first_port():
    def wrong(range_map: Range) -> Transmission: ...

    with pytest.raises(ContractError, match="same kind"):
        contract(stage("test.wrong", identity_when=lambda range_map: None)(wrong))


def test_identity_may_only_ask_for_what_the_stage_has():
    def wrong(range_map: Range) -> Range: ...

    with pytest.raises(ContractError, match="asks for sigma"):
        contract(stage("test.wrong", identity_when=lambda sigma: None)(wrong))
