"""What a run would do: what runs, what is pruned, skipped or cached, and why."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from fogpipe.pipeline.graph import Node, Ref
from fogpipe.pipeline.plan import Plan, plan_for
from fogpipe.runtime.cache import Cache, digest
from fogpipe.runtime.runner import cache_key, execute, identity_reason


@dataclass(frozen=True)
class Row:
    """What becomes of one stage.

    Attributes
    ----------
    fate : ``depends`` where only a scene can tell whether it is skipped.
    """

    name: str
    use: str
    fate: Literal["runs", "pruned", "skipped", "cached", "depends"]
    reason: str = ""


@dataclass(frozen=True)
class Preview:
    """The fate of every stage of a graph, in order.

    Attributes
    ----------
    decided_by : stages that were run to learn which others are the identity on this scene.
    """

    rows: tuple[Row, ...]
    decided_by: tuple[str, ...] = ()


def preview(plan: Plan, inputs: Mapping[str, np.ndarray] | None = None, cache: Cache | None = None) -> Preview:
    """Tell what a run of ``plan`` would do.

    Whether a stage is the identity depends on the scene. With ``inputs`` the stages that the answer
    hangs on are run (with a cache, they stay in it for the run); without, the condition is named.
    """
    conditional = [node for node in plan.nodes.values() if node.contract.condition_arguments]
    if inputs is None:
        depends = {node.name: _condition_in_words(node) for node in conditional}
        rows = [_row(plan, node, "depends" if node.name in depends else "runs", depends) for node in _all(plan)]
        return Preview(tuple(rows))
    deciding = {
        str(ref): ref
        for node in conditional
        for port, ref in node.sources.items()
        if port in node.contract.condition_arguments
    }
    decided = execute(plan_for(plan.graph, deciding), dict(inputs), cache=cache)
    skipped = {
        node.name: reason for node in conditional if (reason := identity_reason(node, _arguments(node, decided.values)))
    }
    cached = _cached(plan, inputs, skipped, cache) if cache else set()
    rows = []
    for node in _all(plan):
        fate = "skipped" if node.name in skipped else "cached" if node.name in cached else "runs"
        rows.append(_row(plan, node, fate, skipped))
    return Preview(tuple(rows), tuple(report.name for report in decided.reports if report.status == "ran"))


def _all(plan: Plan) -> list[Node]:
    return list(plan.graph.nodes.values())


def _row(
    plan: Plan, node: Node, fate: Literal["runs", "skipped", "cached", "depends"], reasons: Mapping[str, str]
) -> Row:
    if node.name in plan.pruned:
        wanted = ", ".join(plan.outputs)
        return Row(node.name, node.contract.name, "pruned", f"{wanted} {'do' if ',' in wanted else 'does'} not need it")
    return Row(node.name, node.contract.name, fate, reasons.get(node.name, ""))


def _condition_in_words(node: Node) -> str:
    condition = node.contract.mark.identity_when
    words = (inspect.getdoc(condition) or "").partition("\n")[0]
    return words or "skipped where it would change nothing"


def _arguments(node: Node, values: Mapping[Ref, np.ndarray]) -> dict[str, Any]:
    ports = {port: values[ref] for port, ref in node.sources.items() if ref in values}
    return ports | dict(node.parameters)


def _cached(plan: Plan, inputs: Mapping[str, np.ndarray], skipped: Mapping[str, str], cache: Cache) -> set[str]:
    """Stages whose result is in the cache, as far as their inputs are known without running anything."""
    digests = {Ref(name): digest(array) for name, array in inputs.items()}
    found: set[str] = set()
    for node in plan.nodes.values():
        if not all(ref in digests for ref in node.sources.values()):
            continue
        if node.name in skipped:
            digests[node.outputs[0]] = digests[node.first_source]
        elif entry := cache.look_up(cache_key(cache, plan, node, digests)):
            found.add(node.name)
            digests |= {ref: entry.digests[ref.port] for ref in node.outputs}
    return found
