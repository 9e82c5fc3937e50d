"""Executes a plan: in topological order, independent stages side by side, each array freed after its last reader."""

from __future__ import annotations

import hashlib
import threading
import time
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fogpipe.errors import StageError
from fogpipe.kernels.bands import threads
from fogpipe.pipeline.graph import Node, Ref
from fogpipe.pipeline.plan import Plan
from fogpipe.runtime.cache import Cache, digest
from fogpipe.runtime.events import Observer, StageReport, Status
from fogpipe.runtime.failure import describe_failure


@dataclass
class Outcome:
    """What a run gave.

    Attributes
    ----------
    values : the plan's targets.
    reports : one per stage, in the order in which they ended.
    peak_bytes : the most memory that values between stages took at any moment.
    """

    values: dict[Ref, np.ndarray] = field(default_factory=dict)
    reports: list[StageReport] = field(default_factory=list)
    peak_bytes: int = 0


def execute(
    plan: Plan,
    inputs: dict[str, np.ndarray],
    *,
    workers: int | None = None,
    cache: Cache | None = None,
    observer: Observer | None = None,
    consume: bool = False,
    known: Mapping[Ref, np.ndarray] | None = None,
) -> Outcome:
    """Run the stages of a plan.

    Parameters
    ----------
    inputs : an array for each of the plan's inputs, already checked; they are never written to.
    workers : stages that may run side by side (default: as many as kernels use threads). The result does
        not depend on it.
    cache : where results are looked up and kept.
    observer : is told of every event.
    consume : empty ``inputs``, so that they too are freed after their last reader.
    known : values that stages outside the plan gave, for those inside that read them.

    Raises
    ------
    StageError
        When a stage fails; other stages that had started are waited for.
    """
    run = _Run(plan, inputs, cache, observer or Observer(), known or {})
    if consume:
        inputs.clear()
    return run.execute(workers or threads())


def random_generator(seed: int, stage_name: str) -> np.random.Generator:
    """The generator of one stage: it depends on the pipeline's seed and the stage's name only."""
    name = int.from_bytes(hashlib.blake2b(stage_name.encode(), digest_size=8).digest(), "little")
    return np.random.default_rng(np.random.SeedSequence([seed, name]))


def frozen(array: np.ndarray) -> np.ndarray:
    """A read-only view."""
    view = array.view()
    view.flags.writeable = False
    return view


@dataclass(frozen=True)
class _Done:
    """One settled stage: its report, and its outputs with their digests where they are known."""

    report: StageReport
    outputs: Mapping[Ref, np.ndarray]
    digests: Mapping[Ref, str] = field(default_factory=dict)


class _Run:
    """The state of one run. Every worker thread takes a ready stage, runs it, and settles what it gave."""

    def __init__(
        self,
        plan: Plan,
        inputs: Mapping[str, np.ndarray],
        cache: Cache | None,
        observer: Observer,
        known: Mapping[Ref, np.ndarray],
    ) -> None:
        self.plan = plan
        self.cache = cache
        self.observer = observer
        self.outcome = Outcome()
        self.values: dict[Ref, np.ndarray] = {}
        self.holders: Counter[int] = Counter()
        self.live_bytes = 0
        self.digests: dict[Ref, str] = {}
        self.readers = Counter(ref for node in plan.nodes.values() for ref in node.sources.values())
        self.readers.update(plan.targets)
        for ref, array in ({Ref(name): inputs[name] for name in plan.inputs} | dict(known)).items():
            if ref in self.readers:
                self._hold(ref, frozen(array))
        self.missing: dict[str, int] = {}
        self.followers: dict[str, list[str]] = {name: [] for name in plan.nodes}
        for name, node in plan.nodes.items():
            feeders = {ref.node for ref in node.sources.values()} & plan.nodes.keys()
            self.missing[name] = len(feeders)
            for feeder in feeders:
                self.followers[feeder].append(name)
        self.ready = deque(name for name, count in self.missing.items() if count == 0)
        self.running = 0
        self.failure: BaseException | None = None
        self.changed = threading.Condition()
        self.helpers: list[threading.Thread] = []

    def execute(self, workers: int) -> Outcome:
        try:
            self._work(workers)
        except BaseException as error:  # an interrupt, too, must not leave helpers waiting
            self._fail(error)
        for helper in self.helpers:
            helper.join()
        if self.failure:
            raise self.failure
        self.outcome.values = {ref: self.values[ref] for ref in self.plan.targets}
        return self.outcome

    def _work(self, workers: int) -> None:
        done: _Done | None = None
        while True:
            with self.changed:
                if done:
                    self._settle(done)
                name = self._next(workers)
            if name is None:
                return
            done = self._run_stage(self.plan.nodes[name])

    def _help(self, workers: int) -> None:
        try:
            self._work(workers)
        except BaseException as error:
            self._fail(error)

    def _fail(self, error: BaseException) -> None:
        with self.changed:
            self.failure = self.failure or error
            self.changed.notify_all()

    def _next(self, workers: int) -> str | None:
        """A stage to run; waits for one while others run. None when all is done or something failed."""
        while not self.ready and self.running and not self.failure:
            self.changed.wait()
        if self.failure or not self.ready:
            return None
        name = self.ready.popleft()
        self.running += 1
        self.observer.started(name)
        if self.ready and len(self.helpers) < workers - 1:
            self.helpers.append(threading.Thread(target=self._help, args=(workers,), name="fogpipe-stage"))
            self.helpers[-1].start()
        return name

    def _run_stage(self, node: Node) -> _Done:
        """Look up, skip or run one stage."""
        started = time.perf_counter()
        key = self._key(node)
        if self.cache and (entry := self.cache.look_up(key)):
            outputs = {ref: entry.arrays[ref.port] for ref in node.outputs}
            digests = {ref: entry.digests[ref.port] for ref in node.outputs}
            return _Done(self._report(node, "cached", started), outputs, digests)
        ports = {port: self.values[ref] for port, ref in node.sources.items()}
        arguments: dict[str, Any] = ports | dict(node.parameters)
        if reason := identity_reason(node, arguments):
            passed = {node.outputs[0]: self.values[node.first_source]}
            return _Done(self._report(node, "skipped", started, reason), passed)
        try:
            if "rng" in node.contract.injected:
                arguments["rng"] = random_generator(self.plan.graph.seed, node.name)
            outputs = dict(_outputs(node, node.contract.function(**arguments), _sizes(node, ports)))
        except Exception as error:
            raise StageError(describe_failure(node, ports, error)) from error
        kept = self.cache.store(key, {ref.port: array for ref, array in outputs.items()}) if self.cache else {}
        digests = {Ref(node.name, port): value for port, value in kept.items()}
        return _Done(self._report(node, "ran", started), outputs, digests)

    def _settle(self, done: _Done) -> None:
        """Take in what a stage gave, free what nobody reads any more, and see which stages became ready."""
        name = done.report.name
        self.outcome.reports.append(done.report)
        self.observer.finished(done.report)
        self.digests.update(done.digests)
        for ref, array in done.outputs.items():
            self._hold(ref, array)
            self.observer.value(ref, array)
        self.outcome.peak_bytes = max(self.outcome.peak_bytes, self.live_bytes)
        sources = self.plan.nodes[name].sources.values()
        self.readers.subtract(sources)
        for ref in {*sources, *done.outputs}:
            if self.readers[ref] <= 0:
                self._release(ref)
        for follower in self.followers[name]:
            self.missing[follower] -= 1
            if self.missing[follower] == 0:
                self.ready.append(follower)
        self.running -= 1
        # This thread takes the next stage itself: to wake another for it would cost more than most stages.
        if len(self.ready) > 1 or not (self.ready or self.running):
            self.changed.notify_all()

    def _hold(self, ref: Ref, array: np.ndarray) -> None:
        self.values[ref] = array
        owner = _owner(array)
        self.holders[id(owner)] += 1
        if self.holders[id(owner)] == 1:
            self.live_bytes += owner.nbytes

    def _release(self, ref: Ref) -> None:
        owner = _owner(self.values.pop(ref))
        self.holders[id(owner)] -= 1
        if self.holders[id(owner)] == 0:
            self.live_bytes -= owner.nbytes

    def _key(self, node: Node) -> str:
        if self.cache is None:
            return ""
        for ref in node.sources.values():
            if ref not in self.digests:
                self.digests[ref] = digest(self.values[ref])
        return cache_key(self.cache, self.plan, node, self.digests)

    @staticmethod
    def _report(node: Node, status: Status, started: float, reason: str = "") -> StageReport:
        return StageReport(node.name, node.contract.name, status, reason, time.perf_counter() - started)


def cache_key(cache: Cache, plan: Plan, node: Node, digests: Mapping[Ref, str]) -> str:
    """Where the cache keeps the result of a node whose inputs have these digests."""
    inputs = {port: digests[ref] for port, ref in node.sources.items()}
    return cache.key(node, inputs, plan.graph.seed if node.contract.injected else None)


def identity_reason(node: Node, arguments: Mapping[str, Any]) -> str | None:
    """Why the stage would return its first port unchanged, or None."""
    condition = node.contract.mark.identity_when
    if condition is None:
        return None
    try:
        return condition(**{name: arguments.get(name) for name in node.contract.condition_arguments})
    except Exception as error:
        ports = {name: value for name, value in arguments.items() if name in node.sources}
        raise StageError(describe_failure(node, ports, error)) from error


def _sizes(node: Node, ports: Mapping[str, np.ndarray]) -> dict[str, int]:
    """The height and width that a stage was given, where all its ports agree."""
    found: dict[str, set[int]] = {}
    for port in node.contract.inputs:
        for symbol, size in port.kind.sizes(ports[port.name]).items() if port.name in ports else ():
            found.setdefault(symbol, set()).add(size)
    return {symbol: sizes.pop() for symbol, sizes in found.items() if len(sizes) == 1}


def _outputs(node: Node, returned: Any, sizes: Mapping[str, int]) -> list[tuple[Ref, np.ndarray]]:
    values = returned if len(node.outputs) > 1 else (returned,)
    outputs = []
    for ref, port, value in zip(node.outputs, node.contract.outputs, values, strict=True):
        array = np.asarray(value)
        if misfit := port.kind.misfit(array):
            raise TypeError(f"it returned, for {ref}, {misfit}; this is a fault of the stage, not of the pipeline")
        if any(sizes.get(symbol, size) != size for symbol, size in port.kind.sizes(array).items()):
            given = " × ".join(map(str, sizes.values()))
            raise TypeError(f"it returned, for {ref}, the shape {array.shape}, but was given {given} pixels")
        outputs.append((ref, frozen(array)))
    return outputs


def _owner(array: np.ndarray) -> np.ndarray:
    """The array that owns the memory of this one: several names may share it, when stages were skipped."""
    while isinstance(array.base, np.ndarray):
        array = array.base
    return array
