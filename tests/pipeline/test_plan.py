"""Only what the outputs need is in the plan."""

from __future__ import annotations

import pytest

from fogpipe.errors import RequestError
from fogpipe.pipeline.plan import make_plan

TEXT = """
inputs: {image: Image, range_map: Range}
stages:
  filled: {use: toy.fill, in: {range_map: range_map}}
  parts: {use: toy.split, in: {range_map: filled}}
  t: {use: toy.transmission, in: {range_map: filled}}
  foggy: {use: toy.paint, in: {image: image, transmission: t}}
  score: {use: toy.mean, in: {image: foggy}}
outputs: {foggy: foggy, far: parts.far}
expect: {score: "> 0"}
"""


def test_everything_is_needed_for_all_outputs_and_expectations(build):
    plan = make_plan(build(TEXT))
    assert set(plan.nodes) == {"filled", "parts", "t", "foggy", "score"}
    assert not plan.pruned


def test_an_output_needs_only_its_ancestors(build):
    plan = make_plan(build(TEXT), ["far"])
    assert list(plan.nodes) == ["filled", "parts"]
    assert set(plan.pruned) == {"t", "foggy", "score"}
    assert plan.inputs == ("range_map",)
    assert not plan.expectations


def test_any_stage_or_port_can_be_asked_for(build):
    assert list(make_plan(build(TEXT), ["t"]).nodes) == ["filled", "t"]
    assert list(make_plan(build(TEXT), ["parts.near"]).nodes) == ["filled", "parts"]


def test_an_unknown_output_gets_a_suggestion(build):
    with pytest.raises(RequestError, match='Did you mean "foggy"'):
        make_plan(build(TEXT), ["fogy"])


def test_an_expectation_of_an_input_that_is_not_needed_is_left_out(build):
    graph = build("""
    inputs: {range_map: Range, k: Length}
    stages: {filled: {use: toy.fill, in: {range_map: range_map}}}
    outputs: {filled: filled, k: k}
    expect: {k: "> 0"}
    """)
    assert not make_plan(graph, ["filled"]).expectations
    assert make_plan(graph, ["k"]).expectations
