"""The checked graph: what flows from where to where."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from fogpipe.ports import Color, Kind
from fogpipe.stage import Contract


class Ref(NamedTuple):
    """A value in the graph: an output of a stage (port ``""`` when it has only one), or an input."""

    node: str
    port: str = ""

    def __str__(self) -> str:
        return f"{self.node}.{self.port}" if self.port else self.node


@dataclass(frozen=True)
class Node:
    """One stage of a graph with its parameters settled.

    Attributes
    ----------
    sources : where each connected port gets its value; optional ports may be absent.
    parameters : every parameter with its validated value.
    """

    name: str
    contract: Contract
    sources: Mapping[str, Ref]
    parameters: Mapping[str, Any]
    origin: str = ""

    @property
    def outputs(self) -> tuple[Ref, ...]:
        return tuple(Ref(self.name, port.name) for port in self.contract.outputs)

    @property
    def first_source(self) -> Ref:
        """What the stage returns when it is skipped: the value of its first port."""
        return self.sources[self.contract.inputs[0].name]


_COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "<": operator.lt,
}


@dataclass(frozen=True)
class Expectation:
    """A bound on a number that the graph computes, such as ``psnr: ">= 40"``."""

    name: str
    ref: Ref
    comparison: str
    bound: float

    @classmethod
    def parse(cls, name: str, ref: Ref, text: str) -> Expectation:
        """Read ``">= 40"``; ValueError where it is something else."""
        match = re.fullmatch(r"\s*(>=|<=|>|<)\s*(\S+)\s*", text)
        if not match:
            raise ValueError(f'"{text}" is not a bound; write it as ">= 40".')
        return cls(name, ref, match[1], float(match[2]))

    def holds(self, value: float) -> bool:
        """Whether ``value`` meets the bound; NaN never does."""
        return _COMPARISONS[self.comparison](value, self.bound)

    def __str__(self) -> str:
        return f"{self.name} {self.comparison} {self.bound:g}"


@dataclass(frozen=True)
class Graph:
    """A pipeline that passed every check.

    Attributes
    ----------
    inputs : kind of each pipeline input.
    nodes : stages by name, each after those it depends on.
    outputs : what each requested name refers to.
    """

    source: str
    title: str
    color: Color
    seed: int
    tolerance: float
    inputs: Mapping[str, Kind]
    nodes: Mapping[str, Node]
    outputs: Mapping[str, Ref]
    expectations: tuple[Expectation, ...] = ()

    def kind(self, ref: Ref) -> Kind:
        """The kind of a value of this graph."""
        if ref.node in self.inputs:
            return self.inputs[ref.node]
        return next(port.kind for port in self.nodes[ref.node].contract.outputs if port.name == ref.port)

    def resolved(self) -> dict[str, Any]:
        """The pipeline as plain data with every parameter written out; reading it gives this graph."""
        return {
            "fogpipe": 1,
            "title": self.title,
            "color": self.color,
            "seed": self.seed,
            "tolerance": self.tolerance,
            "inputs": {name: kind.name for name, kind in self.inputs.items()},
            "stages": {
                name: {
                    "use": node.contract.name,
                    "in": {port: str(ref) for port, ref in node.sources.items()},
                    "with": {key: _plain(value) for key, value in node.parameters.items()},
                }
                for name, node in self.nodes.items()
            },
            "outputs": {name: str(ref) for name, ref in self.outputs.items()},
            "expect": {e.name: f"{e.comparison} {e.bound!r}" for e in self.expectations},
        }


def _plain(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value
