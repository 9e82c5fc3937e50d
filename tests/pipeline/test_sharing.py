"""What graphs that differ in parameters have in common is computed once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fogpipe.pipeline.graph import Graph, Ref
from fogpipe.pipeline.plan import plan_for
from fogpipe.pipeline.sharing import shared_values
from fogpipe.runtime.runner import execute

TEXT = """
seed: 3
inputs: {range_map: Range, image: Image}
stages:
  filled: {use: toy.fill, in: {range_map: range_map}}
  moved: {use: toy.farther, in: {range_map: filled}, with: {distance: 2}}
  light: {use: toy.transmission, in: {range_map: moved}}
  noisy: {use: toy.noise, in: {image: image}}
  painted: {use: toy.paint, in: {image: noisy, transmission: light}}
outputs: {painted: painted, filled: filled}
"""


def graphs(build: Callable[..., Graph], *overrides: dict) -> list[Graph]:
    return [build(TEXT, set=override) for override in overrides]


def test_values_that_no_parameter_reaches_are_shared(build):
    found = graphs(build, {"moved.distance": 1}, {"moved.distance": 4})
    assert shared_values(found, found[0].outputs) == {Ref("filled"), Ref("noisy")}


def test_nothing_but_what_is_read_is_shared(build):
    found = graphs(build, {"moved.distance": 1}, {"moved.distance": 4})
    assert shared_values(found, {"filled": Ref("filled")}) == {Ref("filled")}


def test_all_is_shared_where_nothing_differs(build):
    found = graphs(build, {}, {})
    assert shared_values(found, found[0].outputs) == {Ref("painted"), Ref("filled")}


def test_another_seed_is_another_result_of_what_is_random(build):
    from dataclasses import replace

    (first,) = graphs(build, {})
    assert Ref("noisy") not in shared_values([first, replace(first, seed=4)], first.outputs)


def test_a_plan_with_known_values_runs_the_rest_to_the_same_bytes(build, toy):
    first, second = graphs(build, {"moved.distance": 1}, {"moved.distance": 4})
    inputs = {
        "range_map": np.array([[1, np.nan], [3, 4]], np.float32),
        "image": np.full((2, 2, 3), 0.5, np.float32),
    }
    same = shared_values([first, second], first.outputs)
    known = execute(plan_for(first, {str(ref): ref for ref in same}), dict(inputs)).values
    toy.calls.clear()
    rest = plan_for(second, second.outputs, known=known)
    assert rest.nodes.keys() == {"moved", "light", "painted"}
    assert rest.inputs == ()
    values = execute(rest, {}, known=known).values
    assert "fill" not in toy.calls
    whole = execute(plan_for(second, second.outputs), dict(inputs)).values
    for ref in second.outputs.values():
        np.testing.assert_array_equal(values[ref], whole[ref])
