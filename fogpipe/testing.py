"""Checks for people who write stages.

>>> from fogpipe.testing import check_stage
>>> check_stage(my_stage)  # doctest: +SKIP
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from fogpipe.errors import ContractError
from fogpipe.pipeline.cards import card_data, undocumented
from fogpipe.ports import Kind
from fogpipe.stage import Contract, contract, is_stage

SHAPES = ((6, 9), (1, 1), (1, 7), (5, 1))


def check_stage(
    function: Callable[..., Any],
    *,
    inputs: Mapping[str, Any] | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> None:
    """Check that a function keeps every promise that a stage makes.

    The signature declares kinds; summary, every port and every parameter are documented; defaults
    are valid; on small arrays of several shapes (also read-only and not contiguous ones) the outputs
    have the declared kind and admissible values (or a ValueError, where a port holds a NaN
    or infinity that its kind admits), the inputs are left alone, and two calls give the
    same bytes; and where ``identity_when`` gives a reason, the stage returns its first port unchanged.

    Parameters
    ----------
    function : the stage.
    inputs : arrays for ports that random values do not suit; they fix the shape that is tried.
    parameters : values for parameters without a default, or other than the default.

    Raises
    ------
    AssertionError
        Naming the stage, the promise that it breaks and the case.
    """
    assert is_stage(function), f"{function!r} is no stage: decorate it with @stage('subject.verb')."
    try:
        declared = contract(function)
        settled = declared.model(**(parameters or {}))
    except (ContractError, ValueError) as error:
        raise AssertionError(str(error)) from error
    _check_words(declared)
    values = {name: getattr(settled, name) for name in declared.model.model_fields}
    for case, arrays in _cases(declared, inputs or {}):
        _check_call(declared, f"{declared.name}, {case}", arrays, values)


def example(kind: Kind, height: int, width: int, rng: np.random.Generator) -> np.ndarray:
    """A random array of a kind: values within its bounds (and within 10 above the lower one), nothing missing."""
    sizes = {"H": height, "W": width}
    shape = tuple(sizes.get(size, 3) if isinstance(size, str) else size for size in kind.shapes[0])
    if kind.dtype == "bool":
        return rng.random(shape) < 0.5
    if kind.name == "Camera":
        return np.array([[float(width), 0, width / 2], [0, float(width), height / 2], [0, 0, 1]])
    low = kind.low if np.isfinite(kind.low) else 0.0
    high = kind.high if np.isfinite(kind.high) else (low + 10.0 if kind.unit in ("m", "px") else low + 1.0)
    return np.asarray(rng.uniform(low, high, shape), dtype=np.float32 if shape else np.float64)


def _check_words(declared: Contract) -> None:
    assert inspect.getdoc(declared.function), f"{declared.name} has no docstring."
    data = card_data(declared)
    assert data["summary"], f"{declared.name}: the docstring has no summary line."
    missing = undocumented(declared)
    assert not missing, f"{declared.name}: {', '.join(missing)} not documented under Parameters."
    assert "\nReturns\n---" in (inspect.getdoc(declared.function) or ""), f"{declared.name}: no Returns section."


def _cases(declared: Contract, given: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    fixed = [np.shape(value)[:2] for value in given.values() if np.ndim(value) >= 2]
    for height, width in fixed[:1] or SHAPES:
        rng = np.random.default_rng(7)
        arrays = {p.name: example(p.kind, height, width, rng) for p in declared.inputs if not p.optional}
        arrays |= {name: np.asarray(value) for name, value in given.items()}
        yield f"shape ({height}, {width})", arrays
        yield f"shape ({height}, {width}), not contiguous", {name: _strided(a) for name, a in arrays.items()}
        for code in (np.nan, np.inf):
            holed = {p.name: _with(code, arrays[p.name], p.kind) for p in declared.inputs if p.name in arrays}
            if any(not np.isfinite(array).all() for array in holed.values()):
                yield f"shape ({height}, {width}), with {code}", holed
        full = {p.name: example(p.kind, height, width, rng) for p in declared.inputs if p.optional}
        if full:
            yield f"shape ({height}, {width}), with optional ports", full | arrays


def _with(code: float, array: np.ndarray, kind: Kind) -> np.ndarray:
    """The array with its first value replaced by NaN or infinity, where its kind admits that."""
    if array.ndim < 2 or (kind.nan if np.isnan(code) else kind.infinity) is None:
        return array
    array = array.copy()
    array[0, 0] = code
    return array


def _strided(array: np.ndarray) -> np.ndarray:
    if array.ndim < 2:
        return array
    wide = np.empty((array.shape[0] * 2, array.shape[1] * 2, *array.shape[2:]), array.dtype)
    view = wide[::2, ::2]
    view[...] = array
    return view


def _check_call(declared: Contract, case: str, arrays: Mapping[str, np.ndarray], values: Mapping[str, Any]) -> None:
    locked = {name: array.copy() if array.flags.c_contiguous else array for name, array in arrays.items()}
    before = {name: array.copy() for name, array in locked.items()}
    for array in locked.values():
        array.flags.writeable = False
    try:
        first, second = (_call(declared, locked, values) for _ in range(2))
    except ValueError:
        if any(array.dtype != np.bool_ and not np.isfinite(array).all() for array in locked.values()):
            return  # a stage may refuse what is unknown or infinite, as long as it says so
        raise
    for name, array in locked.items():
        assert np.array_equal(array, before[name], equal_nan=array.dtype != np.bool_), f"{case}: it changed {name}."
    for port, one, other in zip(declared.outputs, first, second, strict=True):
        name = port.name or "the output"
        assert not (problem := port.kind.misfit(one)), f"{case}: {name} has {problem}."
        assert not (problem := port.kind.bad_values(one)), f"{case}: {name}: {problem}."
        assert one.tobytes() == other.tobytes(), f"{case}: two calls give different {name}."
    condition = declared.mark.identity_when
    if condition:
        known = {**locked, **values}
        if reason := condition(**{name: known.get(name) for name in declared.condition_arguments}):
            same = np.array_equal(first[0], locked[declared.inputs[0].name], equal_nan=True)
            assert same, f"{case}: it would be skipped ({reason}), but it changes its first port."


def _call(declared: Contract, arrays: Mapping[str, np.ndarray], values: Mapping[str, Any]) -> tuple[np.ndarray, ...]:
    injected = {"rng": np.random.default_rng(3)} if "rng" in declared.injected else {}
    returned = declared.function(**arrays, **values, **injected)
    return tuple(map(np.asarray, returned if len(declared.outputs) > 1 else (returned,)))
