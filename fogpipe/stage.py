'''Stages: plain functions that a pipeline can use.

The signature is the whole declaration. Positional arguments are input ports (optional ones default
to None), keyword-only arguments are parameters, the return annotation is the output, a NamedTuple
gives several outputs::

    @stage("medium.transmission")
    def transmission(range_map: Range, extinction: Coefficient, *, floor: Annotated[float, Ge(0)] = 0) -> Transmission:
        """Transmission of a scattering medium."""
        return np.maximum(np.exp(-extinction * range_map), floor)

The decorated function is the very function that was written: it is called, tested and imported
with NumPy arrays and no framework. :func:`contract` reads the declaration when a pipeline asks.
'''

from __future__ import annotations

import inspect
import types
import typing
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from fogpipe.errors import ContractError
from fogpipe.ports import Kind, Unit

if TYPE_CHECKING:
    from pydantic import BaseModel

Function = TypeVar("Function", bound=Callable[..., Any])
INJECTED = frozenset({"rng"})
"""Keyword-only arguments that the runner supplies and no pipeline may set."""


@dataclass(frozen=True, slots=True)
class StageMark:
    """What the decorator leaves on the function."""

    name: str
    version: int
    identity_when: Callable[..., str | None] | None
    requires: Callable[..., None] | None


def stage(
    name: str,
    *,
    version: int = 1,
    identity_when: Callable[..., str | None] | None = None,
    requires: Callable[..., None] | None = None,
) -> Callable[[Function], Function]:
    """Declare a function as a stage.

    Parameters
    ----------
    name : ``subject.verb``; the subject is the name of the entry point that holds it.
    version : raise it when the same input gives another result, so that caches know.
    identity_when : a function of some of the stage's own arguments (by name) that returns why the
        stage would return its first port unchanged, or None. The runner then skips the stage.
    requires : a function of some of the stage's parameters (by name) that raises ValueError where their values cannot
        go together. It is called when a pipeline is checked, before anything runs; the stage calls it itself, too,
        for those who call the stage.
    """

    def mark(function: Function) -> Function:
        function.__stage__ = StageMark(name, version, identity_when, requires)  # type: ignore[attr-defined]
        return function

    return mark


@dataclass(frozen=True, slots=True)
class Port:
    """One input or output of a stage."""

    name: str
    kind: Kind
    optional: bool = False


@dataclass(frozen=True)
class Contract:
    """What a stage takes and gives, read from its signature.

    Attributes
    ----------
    inputs, outputs : ports in order. A single output has the name ``""``.
    parameters : keyword-only arguments that a pipeline may set.
    injected : keyword-only arguments that the runner supplies (``rng``).
    condition_arguments : names that ``identity_when`` asks for.
    required_arguments : names that ``requires`` asks for.
    """

    function: Callable[..., Any]
    mark: StageMark
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    parameters: tuple[inspect.Parameter, ...]
    injected: frozenset[str]
    condition_arguments: tuple[str, ...]
    required_arguments: tuple[str, ...]

    @property
    def name(self) -> str:
        return self.mark.name

    @cached_property
    def model(self) -> type[BaseModel]:
        """The pydantic model of the parameters: each by itself, and all of them together by ``requires``."""
        from pydantic import ConfigDict, create_model, model_validator

        fields: dict[str, Any] = {
            p.name: (p.annotation, ... if p.default is p.empty else p.default) for p in self.parameters
        }
        config = ConfigDict(extra="forbid", arbitrary_types_allowed=True, protected_namespaces=())
        requires = self.mark.requires

        def together(model: BaseModel) -> BaseModel:
            if requires:
                requires(**{name: getattr(model, name) for name in self.required_arguments})
            return model

        validators: dict[str, Any] = {"together": model_validator(mode="after")(together)}
        return create_model(self.name, __config__=config, __validators__=validators, **fields)

    @cached_property
    def summary(self) -> str:
        """The first line of the docstring."""
        return (inspect.getdoc(self.function) or "").partition("\n")[0]

    def input(self, name: str) -> Port | None:
        """The input port of that name, or None."""
        return next((port for port in self.inputs if port.name == name), None)


def is_stage(value: object) -> bool:
    """Whether ``value`` is a function decorated with :func:`stage`."""
    return callable(value) and isinstance(getattr(value, "__stage__", None), StageMark)


@cache
def contract(function: Callable[..., Any]) -> Contract:
    """Read the contract of a stage from its signature.

    Raises
    ------
    ContractError
        If a port has no kind, a parameter has no annotation, or ``identity_when`` or ``requires`` cannot work.
    """
    mark: StageMark = function.__stage__  # type: ignore[attr-defined]
    hints = _type_hints(function, mark.name)
    inputs: list[Port] = []
    parameters: list[inspect.Parameter] = []
    for argument in inspect.signature(function).parameters.values():
        if argument.kind in (argument.VAR_POSITIONAL, argument.VAR_KEYWORD):
            raise ContractError(f"stage {mark.name}: *{argument.name} is not possible; name every port and parameter.")
        if argument.name not in hints:
            raise ContractError(f"stage {mark.name}: argument {argument.name} has no annotation.")
        hint = hints[argument.name]
        if argument.kind is argument.KEYWORD_ONLY:
            parameters.append(argument.replace(annotation=hint))
        else:
            inputs.append(_input_port(argument, hint, mark.name))
    outputs = _output_ports(hints.get("return"), mark.name)
    return Contract(
        function=function,
        mark=mark,
        inputs=tuple(inputs),
        outputs=outputs,
        parameters=tuple(p for p in parameters if p.name not in INJECTED),
        injected=frozenset(p.name for p in parameters) & INJECTED,
        condition_arguments=_condition_arguments(mark, inputs, outputs, parameters),
        required_arguments=_arguments(mark, mark.requires, "requires", {p.name for p in parameters} - INJECTED),
    )


def unit_of(annotation: Any) -> str | None:
    """The unit symbol in a parameter's annotation, also where it may be None, or None."""
    if isinstance(annotation, types.UnionType) or typing.get_origin(annotation) is typing.Union:
        return next(filter(None, map(unit_of, typing.get_args(annotation))), None)
    return next((m.symbol for m in getattr(annotation, "__metadata__", ()) if isinstance(m, Unit)), None)


def _type_hints(function: Callable[..., Any], name: str) -> dict[str, Any]:
    try:
        return typing.get_type_hints(function, include_extras=True)
    except NameError as error:
        raise ContractError(
            f"stage {name}: {error}. Import the type at run time, not only under TYPE_CHECKING."
        ) from error


def _kind_of(hint: Any) -> Kind | None:
    if typing.get_origin(hint) is Annotated:
        return next((m for m in hint.__metadata__ if isinstance(m, Kind)), None)
    return None


def _input_port(argument: inspect.Parameter, hint: Any, name: str) -> Port:
    members = typing.get_args(hint) if _kind_of(hint) is None else (hint,)
    optional = type(None) in members
    kinds = [kind for member in members if (kind := _kind_of(member))]
    if len(kinds) != 1:
        raise ContractError(
            f"stage {name}: port {argument.name} has no kind. Annotate it with one of fogpipe.ports,"
            f" or make it a parameter by putting it after '*'."
        )
    if optional != (argument.default is None):
        raise ContractError(
            f"stage {name}: an optional port is written '{argument.name}: {kinds[0].name} | None = None'."
        )
    return Port(argument.name, kinds[0], optional)


def _output_ports(hint: Any, name: str) -> tuple[Port, ...]:
    if (kind := _kind_of(hint)) is not None:
        return (Port("", kind),)
    if inspect.isclass(hint) and issubclass(hint, tuple) and hasattr(hint, "_fields"):
        fields = typing.get_type_hints(hint, include_extras=True)
        ports = [(field, _kind_of(fields[field])) for field in hint._fields]  # type: ignore[attr-defined]
        if all(kind is not None for _, kind in ports):
            return tuple(Port(field, kind) for field, kind in ports if kind)
    raise ContractError(f"stage {name}: the return annotation must be a kind, or a NamedTuple of kinds.")


def _condition_arguments(
    mark: StageMark, inputs: list[Port], outputs: tuple[Port, ...], parameters: list[inspect.Parameter]
) -> tuple[str, ...]:
    if mark.identity_when is None:
        return ()
    if len(outputs) != 1 or not inputs or outputs[0].kind != inputs[0].kind:
        raise ContractError(f"stage {mark.name}: identity_when needs one output of the same kind as the first port.")
    known = {port.name for port in inputs} | {p.name for p in parameters} - INJECTED
    return _arguments(mark, mark.identity_when, "identity_when", known)


def _arguments(mark: StageMark, function: Callable[..., Any] | None, role: str, known: set[str]) -> tuple[str, ...]:
    """The names of the stage's own arguments that one of its conditions asks for."""
    wanted = tuple(inspect.signature(function).parameters) if function else ()
    if unknown := set(wanted) - known:
        raise ContractError(f"stage {mark.name}: {role} asks for {', '.join(sorted(unknown))}, which the stage lacks.")
    return wanted
