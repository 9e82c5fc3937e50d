"""The pipeline file: its form, and how a file is read into it."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import yaml
from annotated_types import Ge, Gt
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from fogpipe.errors import Problem, suggestion
from fogpipe.pipeline.reading import Document, Path, Place, read_value, read_yaml
from fogpipe.ports import Color

Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]


def _not_a_truth_value(value: Any) -> Any:
    return str(value) if isinstance(value, bool) else value  # True equals 1, and is no version


Version = Annotated[Literal[1], BeforeValidator(_not_a_truth_value)]


class StageUse(BaseModel):
    """One stage of the graph."""

    model_config = ConfigDict(extra="forbid", strict=True)

    use: str = Field(description="Name of the stage, as in 'fogpipe stages'.")
    inputs: dict[str, str] = Field({}, alias="in", description="Port: an input, a stage, or stage.output.")
    values: dict[str, Any] = Field(
        {}, alias="with", description="Parameter: a value, or $name of a pipeline parameter."
    )


class PipelineFile(BaseModel):
    """A fogpipe pipeline: typed stages wired into a graph."""

    model_config = ConfigDict(extra="forbid", strict=True)

    fogpipe: Version = Field(description="Version of the file format.")
    title: str = Field("", description="One line for people.")
    color: Color = Field("linear", description="What the numbers mean inside: linear light, or sRGB display values.")
    seed: Annotated[int, Ge(0)] = Field(0, description="Seed of everything random.")
    tolerance: Annotated[float, Gt(0)] = Field(
        0.002, description="Root-mean-square error allowed in each approximated stage, on values in [0, 1]."
    )
    inputs: dict[Name, str] = Field({}, description="Name: kind of each value that a run must give.")
    params: dict[Name, Any] = Field({}, description="Name: default of each parameter that 'with' may use as $name.")
    stages: dict[Name, StageUse] = Field(description="Name: stage.")
    outputs: dict[Name, str] = Field(description="Name of an output: a stage, stage.output, or an input.")
    expect: dict[str, str] = Field(
        {}, description="A number of the graph: a bound such as '>= 40'; a miss fails the run."
    )


@dataclass
class Spec:
    """A pipeline file that was read, with its problems so far.

    Attributes
    ----------
    source : file name, or name of a shipped pipeline.
    file : the content; parts with problems are left out.
    broken : names of stages that were left out, so that references to them are not reported again.
    replaced : items that an override replaced, with what the file says of them.
    said_by : the option that gave an override, by the name of what it sets, where it is not ``--set``.
    strangers : overrides of parameters that the pipeline does not have.
    """

    source: str
    file: PipelineFile
    document: Document
    problems: list[Problem]
    broken: set[str] = field(default_factory=set)
    replaced: dict[Path, Any] = field(default_factory=dict)
    said_by: Mapping[str, str] = field(default_factory=dict)
    strangers: tuple[str, ...] = ()

    def problem(self, path: Path, what: str) -> None:
        """Note a problem with the item at ``path``."""
        if path in self.replaced:
            self.override_problem(".".join(map(str, _option(path))), what)
        else:
            self.problems.append(Problem(*self.document.place(path), ".".join(map(str, path)), what))

    def override_problem(self, name: str, what: str) -> None:
        """Note a problem with the override of ``name``."""
        self.problems.append(Problem(0, 0, f"{self.said_by.get(name, '--set')} {name}", what))


def read_spec(
    text: str,
    source: str,
    overrides: Mapping[str, Any] | None = None,
    said_by: Mapping[str, str] | None = None,
) -> Spec:
    """Read a pipeline from YAML text and apply ``stage.parameter: value`` overrides.

    Every problem of form is noted in the spec; the faulty parts are left out, so that the rest can
    still be checked in the same pass. ``said_by`` names the options that gave the overrides (:class:`Spec`).
    """
    document = read_yaml(text)
    problems = list(document.problems)
    data = document.data
    if not isinstance(data, dict):
        if not problems:
            problems.append(Problem(1, 1, "file", "must be a mapping that starts with 'fogpipe: 1'."))
        data = {}
    replaced, homeless, strangers = _apply(overrides or {}, data)
    file, broken = _validate(copy.deepcopy(data), document, problems if document.data is not None else [])
    spec = Spec(source, file, document, problems, broken, replaced, said_by or {}, strangers)
    for name, what in homeless.items():
        spec.override_problem(name, what)
    return spec


def spec_from_data(data: Mapping[str, Any], source: str) -> Spec:
    """A spec from plain data, such as the resolved pipeline in a run record."""
    return read_spec(yaml.safe_dump(dict(data), sort_keys=False, allow_unicode=True), source)


def parse_override(text: str) -> tuple[str, Any]:
    """Split ``name=value`` or ``stage.parameter=value``; the value is read as YAML.

    Raises
    ------
    ValueError
        If there is no ``=`` or the value is not YAML.
    """
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise ValueError(f"--set {text}: write it as stage.parameter=value or parameter=value.")
    try:
        return name.strip(), read_value(value)
    except yaml.YAMLError as error:
        raise ValueError(f"--set {text}: the value is not valid YAML.") from error


def _apply(
    overrides: Mapping[str, Any], data: dict[str, Any]
) -> tuple[dict[Path, Any], dict[str, str], tuple[str, ...]]:
    """Put overrides in their places: what was there; what is wrong with those of no stage; those of no parameter."""
    replaced: dict[Path, Any] = {}
    homeless: dict[str, str] = {}
    strangers: list[str] = []
    stages = data["stages"] if isinstance(data.get("stages"), dict) else {}
    params = data["params"] if isinstance(data.get("params"), dict) else {}
    for name, value in overrides.items():
        stage, dot, parameter = name.partition(".")
        if dot and isinstance(stages.get(stage), dict):
            if not isinstance(stages[stage].setdefault("with", {}), dict):
                continue  # which is reported as it is
            replaced["stages", stage, "with", parameter] = stages[stage]["with"].get(parameter)
            stages[stage]["with"][parameter] = value
        elif not dot and name in params:
            replaced["params", name] = params[name]
            params[name] = value
        elif dot:
            homeless[name] = f'there is no stage "{stage}".{suggestion(stage, stages)}'
        else:
            strangers.append(name)
    return replaced, homeless, tuple(strangers)


def _option(path: Path) -> Path:
    return (path[1], path[3]) if path[0] == "stages" else path[1:]


def _validate(data: dict[str, Any], document: Document, problems: list[Problem]) -> tuple[PipelineFile, set[str]]:
    """Validate; leave out what is faulty and try again until the rest is sound."""
    broken: set[str] = set()
    while True:
        try:
            return PipelineFile.model_validate(data), broken
        except ValidationError as error:
            left_out: list[Path] = []
            for fault in error.errors():
                path = tuple(part for part in fault["loc"] if part != "[key]")
                place: Place = document.place(path)
                problems.append(Problem(*place, ".".join(map(str, path)), _explain(fault, path)))
                if path[0] == "stages" and len(path) > 1 and (len(path) == 2 or path[2] == "use"):
                    broken.add(str(path[1]))
                    path = path[:2]
                if not any(path[: len(gone)] == gone for gone in left_out):
                    _leave_out(data, path)
                    left_out.append(path)


def _explain(fault: Any, path: Path) -> str:
    known = {1: PipelineFile, 3: StageUse}.get(len(path))
    if fault["type"] == "extra_forbidden" and known is not None:
        names = [info.alias or name for name, info in known.model_fields.items()]
        return f"is not a key here.{suggestion(str(path[-1]), names)}"
    if fault["type"] == "missing":
        return "is missing."
    if fault["type"] == "string_pattern_mismatch":
        return "is not a name: use a letter, then letters, digits and underscores."
    return f"{fault['msg'].replace('Input should', 'should')}, not {fault['input']!r}."


_FALLBACK = {"fogpipe": 1, "stages": {}, "outputs": {}}


def _leave_out(data: Any, path: Path) -> None:
    *parents, last = path
    for part in parents:
        data = data[part]
    if not parents and last in _FALLBACK:
        data[last] = copy.deepcopy(_FALLBACK[last])
    else:
        data.pop(last, None)
