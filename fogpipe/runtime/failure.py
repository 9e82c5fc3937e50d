"""What a person is told when a stage fails: the stage, what it was given, and what to do."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fogpipe.pipeline.graph import Node


def describe_failure(node: Node, ports: Mapping[str, np.ndarray], error: Exception) -> str:
    """The message for a failed stage; the exception itself is chained to it."""
    lines = [f'stage "{node.name}" ({node.contract.name}, {node.origin}) failed: {type(error).__name__}: {error}']
    for name, array in ports.items():
        port = node.contract.input(name)
        lines.append(f"  {name}: {port.kind.name if port else ''} {describe(array)}")
    settings = ", ".join(f"{key}={value!r}" for key, value in node.parameters.items())
    lines.append(f"  with {settings or 'no parameters'}")
    if isinstance(error, ValueError):
        lines.append("  Change its parameters or its inputs. With --cache DIR the stages before it need not run again.")
    else:
        lines.append("  This is a fault of the stage; fogpipe --debug shows where.")
    return "\n".join(lines)


def describe(array: np.ndarray) -> str:
    """Shape, dtype and range of an array, never its contents."""
    text = f"shape {array.shape} {array.dtype}"
    if array.dtype == np.bool_ or not array.size:
        return text
    finite = array[np.isfinite(array)]
    if finite.size:
        text += f", {finite.min():.4g} … {finite.max():.4g}"
    if unknown := int(np.isnan(array).sum()):
        text += f", {unknown} NaN"
    if infinite := int(np.isinf(array).sum()):
        text += f", {infinite} inf"
    return text
