"""What a run needs: the stages that the requested outputs depend on, and nothing else."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from fogpipe.errors import RequestError, suggestion
from fogpipe.pipeline.graph import Graph, Node, Ref


@dataclass(frozen=True)
class Plan:
    """The part of a graph that some outputs need.

    Attributes
    ----------
    nodes : stages to run, each after those it depends on.
    pruned : stages that none of the outputs needs.
    outputs : the requested outputs.
    inputs : the pipeline inputs that are needed.
    """

    graph: Graph
    nodes: Mapping[str, Node]
    pruned: tuple[str, ...]
    outputs: Mapping[str, Ref]
    inputs: tuple[str, ...]

    @property
    def targets(self) -> frozenset[Ref]:
        """Every value that must be there at the end."""
        return frozenset(self.outputs.values()) | {e.ref for e in self.expectations}

    @property
    def expectations(self) -> tuple:
        """The expectations that this part of the graph can answer without further work."""
        return tuple(e for e in self.graph.expectations if e.ref.node in self.nodes or e.ref.node in self.inputs)


def make_plan(graph: Graph, to: Iterable[str] | None = None) -> Plan:
    """Prune a graph to the outputs ``to`` (all, and all expectations, when None).

    A name in ``to`` is an output of the pipeline, or any stage or ``stage.output`` in it.

    Raises
    ------
    RequestError
        If a name is none of these.
    """
    if to is None:
        return plan_for(graph, graph.outputs, extra={e.ref for e in graph.expectations})
    return plan_for(graph, {name: _find(graph, name) for name in to})


def plan_for(graph: Graph, outputs: Mapping[str, Ref], extra: Iterable[Ref] = (), known: Collection[Ref] = ()) -> Plan:
    """The plan that computes these values, given those that are ``known`` already."""
    needed: set[str] = set()
    pending = [ref.node for ref in (*outputs.values(), *extra) if ref not in known]
    while pending:
        name = pending.pop()
        if name not in needed:
            needed.add(name)
            sources = graph.nodes[name].sources.values() if name in graph.nodes else ()
            pending += [ref.node for ref in sources if ref not in known]
    return Plan(
        graph=graph,
        nodes={name: node for name, node in graph.nodes.items() if name in needed},
        pruned=tuple(name for name in graph.nodes if name not in needed),
        outputs=dict(outputs),
        inputs=tuple(name for name in graph.inputs if name in needed),
    )


def _find(graph: Graph, name: str) -> Ref:
    if name in graph.outputs:
        return graph.outputs[name]
    refs = {str(ref): ref for node in graph.nodes.values() for ref in node.outputs}
    if name in refs:
        return refs[name]
    raise RequestError(f"--to {name}: there is no such output.{suggestion(name, [*graph.outputs, *refs])}")
