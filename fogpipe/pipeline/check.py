"""Checks a pipeline and builds its graph: every problem in one pass, nothing run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import networkx as nx

from fogpipe.errors import ContractError, PipelineError, UnknownStageError, closest, suggestion
from fogpipe.pipeline.graph import Expectation, Graph, Node, Ref
from fogpipe.pipeline.parameters import Fault, settled
from fogpipe.pipeline.reading import Path
from fogpipe.pipeline.spec import Spec
from fogpipe.ports import Kind, known_kinds
from fogpipe.registry import Registry
from fogpipe.stage import Contract, Port

RESERVED = frozenset({"self", "to", "workers", "cache", "observer"})
"""Names that an input cannot have, since it is given as a keyword argument beside these."""


def check(spec: Spec, registry: Registry) -> Graph:
    """Build the graph of a spec.

    Raises
    ------
    PipelineError
        With every problem found: form, unknown names, kinds, parameters, cycles, what is unused.
    """
    graph = _Checker(spec, registry).graph()
    if spec.problems:
        raise PipelineError(spec.source, spec.problems)
    return graph


class _Checker:
    """One pass over a spec. Every method notes what is wrong and goes on."""

    def __init__(self, spec: Spec, registry: Registry) -> None:
        self.spec = spec
        self.file = spec.file
        self.registry = registry
        self.contracts: dict[str, Contract] = {}
        self.inputs: dict[str, Kind] = {}
        self.unresolved: set[str] = set(spec.broken)
        self.used_params = {value[1:] for value in spec.replaced.values() if _is_parameter(value)}
        self.meant: set[str] = set()
        self.unsettled: set[Path] = set()

    def graph(self) -> Graph:
        self._find_stages()
        self._find_inputs()
        nodes = {name: self._node(name, contract) for name, contract in self.contracts.items()}
        outputs = {name: ref for name, text in self.file.outputs.items() if (ref := self._output(name, text))}
        expectations = [found for name in self.file.expect if (found := self._expectation(name))]
        if not self.file.outputs and not any(problem.where in ("file", "outputs") for problem in self.spec.problems):
            self.spec.problem(("outputs",), "is empty; name at least one output.")
        order = self._order(nodes)
        self._report_strangers()
        self._report_unused()
        return Graph(
            source=self.spec.source,
            title=self.file.title,
            color=self.file.color,
            seed=self.file.seed,
            tolerance=self.file.tolerance,
            inputs=self.inputs,
            nodes={name: nodes[name] for name in order},
            outputs=outputs,
            expectations=tuple(expectations),
        )

    def _find_stages(self) -> None:
        for name, use in self.file.stages.items():
            try:
                self.contracts[name] = self.registry.find(use.use)
            except (UnknownStageError, ContractError) as error:
                self.spec.problem(("stages", name, "use"), str(error))
                self.unresolved.add(name)

    def _find_inputs(self) -> None:
        kinds = known_kinds() | {
            port.kind.name: port.kind for c in self.contracts.values() for port in (*c.inputs, *c.outputs)
        }
        for name, kind in self.file.inputs.items():
            if kind not in kinds:
                self.spec.problem(("inputs", name), f'there is no kind "{kind}".{suggestion(kind, kinds)}')
                self.unresolved.add(name)
            elif name in RESERVED:
                self.spec.problem(("inputs", name), "is an option of Pipeline.run; choose another name.")
            elif name in self.file.stages:
                self.spec.problem(("inputs", name), "is also the name of a stage; rename one of them.")
            else:
                self.inputs[name] = kinds[kind]

    def _node(self, name: str, contract: Contract) -> Node:
        use = self.file.stages[name]
        path: Path = ("stages", name)
        sources: dict[str, Ref] = {}
        for port_name, text in use.inputs.items():
            port = contract.input(port_name)
            if port is None:
                self.spec.problem((*path, "in", port_name), self._not_a_port(contract, port_name))
            elif ref := self._source(port, text, (*path, "in", port_name)):
                sources[port_name] = ref
        for port in contract.inputs:
            if not port.optional and port.name not in use.inputs:
                self.spec.problem(
                    (*path, "in"), f"{contract.name} needs {port.name} ({port.kind}).{self._givers(port.kind)}"
                )
        return Node(name, contract, sources, self._parameters(name, contract), self.registry.origin(contract.name))

    def _not_a_port(self, contract: Contract, name: str) -> str:
        if name in contract.model.model_fields:
            return f"is a parameter of {contract.name}; put its value under 'with'."
        return f"is not a port of {contract.name}.{suggestion(name, [port.name for port in contract.inputs])}"

    def _source(self, port: Port, text: str, path: Path) -> Ref | None:
        ref, kind = self._resolve(text, path, port.kind)
        if kind is None or kind == port.kind:
            return ref
        self.spec.problem(path, f'takes {port.kind}, but "{text}" is {_article(kind.name)}.{self._givers(port.kind)}')
        return None

    def _resolve(self, text: str, path: Path, wanted: Kind | None = None) -> tuple[Ref | None, Kind | None]:
        """The value that ``text`` refers to and its kind; (None, None) where that was reported."""
        name, _, output = text.partition(".")
        if name in self.inputs and not output:
            return Ref(name), self.inputs[name]
        if name in self.contracts:
            ports = {port.name: port.kind for port in self.contracts[name].outputs}
            if output in ports:
                return Ref(name, output), ports[output]
            if "" in ports:
                self.spec.problem(path, f'"{name}" has one output; write "{name}".')
            else:
                names = [f"{name}.{port}" for port, kind in ports.items() if wanted in (None, kind)]
                names = names or [f"{name}.{port}" for port in ports]
                if output:
                    self.spec.problem(path, f'"{text}" is not an output of "{name}".{suggestion(text, names)}')
                else:
                    self.spec.problem(path, f'"{name}" has several outputs; write {" or ".join(names)}.')
        elif name not in self.unresolved:
            names = [*self.inputs, *self.contracts]
            meant = closest(name, names)
            self.meant.update([meant] if meant else ())
            hint = suggestion(name, names) if meant or wanted is None else self._givers(wanted)
            self.spec.problem(path, f'there is no stage or input "{name}".{hint}')
        return None, None

    def _givers(self, kind: Kind) -> str:
        """What in this pipeline gives a kind, as a line of its own."""
        names = [name for name, given in self.inputs.items() if given == kind]
        for name, contract in self.contracts.items():
            names += [str(Ref(name, port.name)) for port in contract.outputs if port.kind == kind]
        return (
            f"\nPorts here that give {kind.name}: {', '.join(names)}."
            if names
            else f"\nNothing here gives {kind.name}."
        )

    def _parameters(self, name: str, contract: Contract) -> Mapping[str, Any]:
        use = self.file.stages[name]
        given: dict[str, Any] = {}
        for key, value in use.values.items():
            path = ("stages", name, "with", key)
            if key in contract.injected:
                self.spec.problem(path, "is supplied by the runner, from the pipeline's seed; leave it out.")
            elif contract.input(key) is not None:
                self.spec.problem(path, f"is a port of {contract.name}; put a reference to its value under 'in'.")
            else:
                given[key] = self._substituted(value, path)
        if "tolerance" in contract.model.model_fields:
            given.setdefault("tolerance", self.file.tolerance)
        values, faults = settled(contract, given)
        for fault in faults:
            self._report_parameters(name, fault)
        return values

    def _report_parameters(self, name: str, fault: Fault) -> None:
        """Tell a fault where the last of its parameters was said; the command line comes after the file."""
        paths: list[Path] = [("stages", name, "with", parameter) for parameter in fault.parameters]
        if not self.unsettled.isdisjoint(paths):
            return
        overridden = self.spec.replaced
        said = [path for path in paths if path in overridden or path in self.spec.document.places]
        told = max(said, key=lambda path: (path in overridden, self.spec.document.place(path)), default=())
        hint = ""
        if told in overridden and (in_file := [str(path[-1]) for path in said if path not in overridden]):
            hint = (
                f" The file sets {' and '.join(in_file)}; null takes that back, as in --set {name}.{in_file[0]}=null."
            )
        self.spec.problem(told or (*paths, ("stages", name))[0], fault.what + hint)

    def _substituted(self, value: Any, path: Path) -> Any:
        if isinstance(value, list):
            return [self._substituted(item, path) for item in value]
        if isinstance(value, dict):
            return {key: self._substituted(item, path) for key, item in value.items()}
        if not _is_parameter(value):
            return value
        name = value[1:]
        self.used_params.add(name)
        if name not in self.file.params:
            self.used_params.add(closest(name, self.file.params) or name)  # which is what was meant to be used
            self.unsettled.add(path)
            self.spec.problem(path, f'there is no parameter "{name}" under params.{suggestion(name, self.file.params)}')
            return None
        return self.file.params[name]

    def _output(self, name: str, text: str) -> Ref | None:
        return self._resolve(text, ("outputs", name))[0]

    def _expectation(self, name: str) -> Expectation | None:
        path: Path = ("expect", name)
        ref, kind = self._resolve(self.file.outputs.get(name, name), path)
        if ref is None or kind is None:
            return None
        if not kind.is_scalar:
            self.spec.problem(path, f"is {_article(kind.name)}; only a single number can be expected.")
            return None
        try:
            return Expectation.parse(name, ref, self.file.expect[name])
        except ValueError as error:
            self.spec.problem(path, str(error))
            return None

    def _order(self, nodes: Mapping[str, Node]) -> list[str]:
        """Topological order, ties in the order of the file."""
        edges = nx.DiGraph()
        edges.add_nodes_from(nodes)
        edges.add_edges_from(
            (ref.node, name) for name, node in nodes.items() for ref in node.sources.values() if ref.node in nodes
        )
        for knot in nx.strongly_connected_components(edges):
            if len(knot) > 1 or any(edges.has_edge(name, name) for name in knot):
                cycle = [start for start, _ in nx.find_cycle(edges, min(knot))]
                path: Path = ("stages", cycle[0])
                self.spec.problem(
                    path, f"is part of a cycle: {' → '.join([*cycle, cycle[0]])}. Break one of these edges."
                )
        if not nx.is_directed_acyclic_graph(edges):
            return list(nodes)
        position = {name: index for index, name in enumerate(nodes)}
        return list(nx.lexicographical_topological_sort(edges, key=position.__getitem__))

    def _report_strangers(self) -> None:
        """Overrides that name no stage, with the parameter that may be meant: of the pipeline or of some stages."""
        known = {name: [name] for name in self.file.params}
        for stage, contract in self.contracts.items():
            for name in contract.model.model_fields:
                known.setdefault(name, []).append(f"{stage}.{name}")
        for name in self.spec.strangers:
            meant = known.get(closest(name, known) or "", [])
            hint = f"Did you mean {' or '.join(meant[:3])}?" if meant else "Write it as STAGE.PARAMETER=VALUE."
            self.spec.override_problem(name, f'there is no parameter of the pipeline "{name}". {hint}')

    def _report_unused(self) -> None:
        # By name and not by sound edges: what hangs on a faulty edge is meant to be used.
        feeders = {
            name: {text.partition(".")[0] for text in use.inputs.values()} for name, use in self.file.stages.items()
        } | {name: self._feeders_of_broken(name) for name in self.spec.broken}
        used: set[str] = set(self.meant)
        pending = [text.partition(".")[0] for text in (*self.file.outputs.values(), *self.file.expect, *self.meant)]
        while pending:
            name = pending.pop()
            used.add(name)
            pending += feeders.pop(name, ())
        for section, names in (("stages", self.file.stages), ("inputs", self.file.inputs)):
            for name in names:
                if name not in used:
                    hint = " or name it in outputs" if section == "stages" else ""
                    self.spec.problem((section, name), f"is unused: no output depends on it. Remove it{hint}.")
        for name in self.file.params:
            if name not in self.used_params:
                self.spec.problem(("params", name), f"is unused: no 'with' holds ${name}. Remove it.")

    def _feeders_of_broken(self, name: str) -> set[str]:
        ports = self.spec.document.data["stages"][name]
        ports = ports.get("in") if isinstance(ports, dict) else None
        return {str(text).partition(".")[0] for text in ports.values()} if isinstance(ports, dict) else set()


def _is_parameter(value: Any) -> bool:
    return isinstance(value, str) and value.startswith("$")


def _article(name: str) -> str:
    return f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"
