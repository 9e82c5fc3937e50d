"""What graphs that differ only in parameters have in common, so that it is computed once."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from fogpipe.pipeline.graph import Graph, Node, Ref
from fogpipe.pipeline.plan import plan_for


def shared_values(graphs: Sequence[Graph], outputs: Mapping[str, Ref]) -> frozenset[Ref]:
    """Values that are the same in all graphs and that the parts which differ, or the outputs, read.

    Parameters
    ----------
    graphs : the same stages and edges; parameters and seeds may differ.
    outputs : what is wanted of each graph.
    """
    first, *others = graphs
    plan = plan_for(first, outputs)
    differing: set[str] = set()
    for name, node in plan.nodes.items():  # each after those that it depends on
        if any(_differs(node, first, other) for other in others) or _reads(node, differing):
            differing.add(name)
    read = {ref for name in differing for ref in plan.nodes[name].sources.values()} | set(outputs.values())
    return frozenset(ref for ref in read if ref.node in plan.nodes and ref.node not in differing)


def _differs(node: Node, graph: Graph, other: Graph) -> bool:
    draws_anew = bool(node.contract.injected) and graph.seed != other.seed
    return draws_anew or node.parameters != other.nodes[node.name].parameters


def _reads(node: Node, stages: Collection[str]) -> bool:
    return any(ref.node in stages for ref in node.sources.values())
