"""A pipeline that can be run from Python."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fogpipe.errors import ExpectationError, RequestError
from fogpipe.pipeline.check import check
from fogpipe.pipeline.graph import Graph
from fogpipe.pipeline.plan import Plan, make_plan
from fogpipe.pipeline.shipped import read_pipeline
from fogpipe.pipeline.spec import read_spec
from fogpipe.registry import Registry
from fogpipe.runtime.cache import Cache
from fogpipe.runtime.events import Observer, StageReport
from fogpipe.runtime.inputs import Inputs, inputs_from_arrays
from fogpipe.runtime.runner import execute


@dataclass(frozen=True, repr=False)
class Result(Mapping[str, np.ndarray]):
    """The outputs of a run by name, and how it went.

    Attributes
    ----------
    reports : one per stage: ran, skipped (with the reason) or cached, and its time.
    missed : the expectations that were not met, in words.
    peak_bytes : the most memory that values between stages took at any moment.
    """

    outputs: Mapping[str, np.ndarray]
    reports: Sequence[StageReport] = ()
    missed: Sequence[str] = ()
    peak_bytes: int = 0

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.outputs:
            raise KeyError(f'there is no output "{name}" here; there is: {", ".join(self.outputs)}')
        return self.outputs[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.outputs)

    def __len__(self) -> int:
        return len(self.outputs)

    def __repr__(self) -> str:
        outputs = ", ".join(f"{name}: {array.dtype} {array.shape}" for name, array in self.outputs.items())
        return f"Result({outputs})"


@dataclass(frozen=True)
class Pipeline:
    """A checked pipeline.

    Attributes
    ----------
    graph : stages and edges, every parameter settled.
    registry : where its stages were found.
    """

    graph: Graph
    registry: Registry = field(repr=False)

    def plan(self, to: Iterable[str] | None = None) -> Plan:
        """What a run to these outputs needs (all outputs when None)."""
        return make_plan(self.graph, to)

    def run(
        self,
        *,
        to: Iterable[str] | None = None,
        workers: int | None = None,
        cache: Cache | Path | str | None = None,
        observer: Observer | None = None,
        **inputs: Any,
    ) -> Result:
        """Run on arrays.

        Parameters
        ----------
        to : outputs, stages or ``stage.output`` to compute; only what they need runs.
        workers : stages that may run side by side; the result does not depend on it.
        cache : a folder for results of stages, or None.
        observer : is told of every event.
        **inputs : an array (or number) for each input of the pipeline. Pictures of integers are sRGB
            display values; pictures of floats are in the pipeline's working space.

        Raises
        ------
        InputError
            If an input is missing, unknown, or not of its kind.
        StageError
            If a stage fails.
        ExpectationError
            If an ``expect`` of the pipeline is missed; its ``result`` holds what was computed.
        """
        plan = self.plan(to)
        cache = Cache(cache) if isinstance(cache, (str, Path)) else cache
        result = run_plan(plan, inputs_from_arrays(plan, inputs), workers=workers, cache=cache, observer=observer)
        if result.missed:
            raise ExpectationError("\n".join(result.missed), result)
        return result


def run_plan(
    plan: Plan,
    inputs: Inputs,
    *,
    workers: int | None = None,
    cache: Cache | None = None,
    observer: Observer | None = None,
) -> Result:
    """Run a plan on checked inputs, which it uses up, and hold what it gave against what the pipeline expects."""
    outcome = execute(plan, inputs.values, workers=workers, cache=cache, observer=observer, consume=True)
    missed = []
    for expectation in plan.expectations:
        value = float(outcome.values[expectation.ref])
        if not expectation.holds(value):
            missed.append(f"{plan.graph.source}: expected {expectation}, but it is {value:g}.")
    outputs = {name: outcome.values[ref] for name, ref in plan.outputs.items()}
    return Result(outputs, outcome.reports, missed, outcome.peak_bytes)


def load(
    name: str | Path,
    *,
    set: Mapping[str, Any] | None = None,
    seed: int | None = None,
    tolerance: float | None = None,
    plugins: Iterable[Path | str] = (),
) -> Pipeline:
    """Load and check a pipeline.

    Parameters
    ----------
    name : a shipped pipeline such as ``"hansard2019"``, or the path of a YAML file.
    set : values that replace the file's: ``{"stage.parameter": value, "parameter": value}``.
    seed, tolerance : replace the file's.
    plugins : local folders of stages.

    Raises
    ------
    InputError
        If there is no such pipeline.
    PipelineError
        With every problem in it.
    RequestError
        If the seed or the tolerance cannot be.
    """
    text, source = read_pipeline(name)
    return from_text(text, source, set=set, seed=seed, tolerance=tolerance, registry=Registry(plugins))


def from_text(
    text: str,
    source: str,
    *,
    set: Mapping[str, Any] | None = None,
    said_by: Mapping[str, str] | None = None,
    seed: int | None = None,
    tolerance: float | None = None,
    registry: Registry | None = None,
) -> Pipeline:
    """Check a pipeline that was read; otherwise as :func:`load`.

    Parameters
    ----------
    source : what messages call it.
    said_by : the option that messages name for a value of ``set``, by its name; ``--set`` where there is none.
    """
    if seed is not None and seed < 0:
        raise RequestError(f"seed {seed}: must be 0 or more.")
    if tolerance is not None and not 0 < tolerance < math.inf:
        raise RequestError(f"tolerance {tolerance:g}: must be a number greater than 0.")
    registry = registry or Registry()
    spec = read_spec(text, source, set, said_by)
    if seed is not None:
        spec.file.seed = seed
    if tolerance is not None:
        spec.file.tolerance = tolerance
    return Pipeline(check(spec, registry), registry)
