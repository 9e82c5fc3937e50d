"""The record of a run, ``run.json``, and its replay."""

from __future__ import annotations

import json
import math
import platform
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import fogpipe
from fogpipe.errors import InputError
from fogpipe.pipeline.graph import Graph, Node
from fogpipe.pipeline.plan import Plan
from fogpipe.ports import Kind
from fogpipe.runtime.cache import digest
from fogpipe.runtime.code import code_digest
from fogpipe.runtime.inputs import Inputs, Request
from fogpipe.runtime.outputs import Options
from fogpipe.runtime.pipeline import Result

RECORD_VERSION = 1
_LIBRARIES = (
    "numpy",
    "scipy",
    "scikit-image",
    "opencv-contrib-python-headless",
    "numba",
    "pillow",
    "imageio",
    "OpenEXR",
)


def make_record(
    plan: Plan,
    request: Request,
    options: Options,
    inputs: Mapping[str, Any],
    notes: Sequence[str],
    result: Result,
    files: Mapping[str, dict[str, str]],
    seconds: float,
) -> dict[str, Any]:
    """Everything that is needed to say how the outputs were made, and to make them again.

    ``inputs`` is what :func:`describe_inputs` said of them before the run used them up.
    """
    graph = plan.graph
    return {
        "record": RECORD_VERSION,
        "fogpipe": fogpipe.__version__,
        "source": graph.source,
        "pipeline": graph.resolved(),
        "request": request.to_data(graph.inputs),
        "options": asdict(options),
        "inputs": inputs,
        "notes": list(notes),
        "outputs": {
            name: _describe(graph.kind(plan.outputs[name]), array) | files.get(name, {})
            for name, array in result.items()
        },
        "stages": [asdict(report) | _facts(plan.nodes[report.name]) for report in result.reports],
        "pruned": list(plan.pruned),
        "expectations_missed": list(result.missed),
        "seconds": seconds,
        "peak_memory_bytes": peak_memory(),
        "peak_array_bytes": result.peak_bytes,
        "versions": library_versions(),
        "platform": platform.platform(),
    }


def read_record(path: Path) -> dict[str, Any]:
    """Read a ``run.json``.

    Raises
    ------
    InputError
        If it cannot be read or is not a record of this form.
    """
    from fogpipe.io.files import read_bytes

    try:
        record = json.loads(read_bytes(path, may_be_empty=True))
    except ValueError as error:
        raise InputError(f"{path} cannot be read as a run record: {error}.") from error
    needed = {"record", "pipeline", "request", "options", "inputs", "outputs", "source"}
    if not isinstance(record, dict) or not needed <= record.keys():
        raise InputError(f"{path} is not a run record; give the run.json that a run wrote beside its outputs.")
    if record["record"] != RECORD_VERSION:
        raise InputError(f"{path} is of record version {record['record']}; this fogpipe reads {RECORD_VERSION}.")
    return record


def describe_inputs(graph: Graph, inputs: Inputs) -> dict[str, Any]:
    """What a record says of each input: kind, shape, dtype, digest and source."""
    return {
        name: _describe(graph.inputs[name], array) | {"source": inputs.sources.get(name, "array")}
        for name, array in inputs.values.items()
    }


def changed_inputs(record: Mapping[str, Any], inputs: Mapping[str, Any]) -> list[str]:
    """Inputs, described, whose content is not what the record says."""
    return [name for name, now in inputs.items() if now["digest"] != record["inputs"].get(name, {}).get("digest")]


def changed_outputs(record: Mapping[str, Any], outcome: Mapping[str, Any]) -> list[str]:
    """Outputs of ``outcome`` (another record) that are not the recorded bytes."""
    return [
        name
        for name, before in record["outputs"].items()
        if any(before.get(key) != outcome["outputs"][name].get(key) for key in ("digest", "sha256"))
    ]


def changed_versions(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """Libraries and stages that are not the same in two records, in words."""
    now = after["versions"]
    libraries = [
        f"{name} {then} → {now.get(name)}" for name, then in before["versions"].items() if now.get(name) != then
    ]
    code = {stage["name"]: stage["code"] for stage in before["stages"]}
    changed = [stage["name"] for stage in after["stages"] if code.get(stage["name"]) != stage["code"]]
    return libraries + ([f"the code of {', '.join(changed)} has changed"] if changed else [])


def peak_memory() -> int | None:
    """The most memory that this process has held, in bytes; None where the system does not tell."""
    status = Path("/proc/self/status")
    if status.exists():  # Linux counts what the parent held at the fork into getrusage's number, but not into this one
        line = next((line for line in status.read_text().splitlines() if line.startswith("VmHWM:")), None)
        if line:
            return int(line.split()[1]) * 1024
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def strict_json(data: Any) -> str:
    """JSON in which a number that is not finite is a text ("inf", "nan"), since JSON has no number for it."""
    return json.dumps(_finite(data), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _finite(data: Any) -> Any:
    if isinstance(data, Mapping):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_finite(value) for value in data]
    return str(data) if isinstance(data, float) and not math.isfinite(data) else data


def _facts(node: Node) -> dict[str, Any]:
    mark = node.contract.mark
    return {"version": mark.version, "origin": node.origin, "code": code_digest(node.contract.function)}


def _describe(kind: Kind, array: Any) -> dict[str, Any]:
    facts = {"kind": kind.name, "shape": list(array.shape), "dtype": str(array.dtype), "digest": digest(array)}
    return facts | ({} if kind.is_per_pixel(array) else {"value": array.tolist()})


@cache
def library_versions() -> Mapping[str, str]:
    """Versions of fogpipe, of Python, and of the libraries that pixels depend on."""
    found = {"fogpipe": fogpipe.__version__, "python": platform.python_version()}
    for name in _LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
