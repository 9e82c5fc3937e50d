"""Every problem of a pipeline in one pass, each with its place and what to do."""

from __future__ import annotations

from textwrap import dedent

import pytest

from fogpipe.errors import PipelineError, Problem
from fogpipe.pipeline.check import check
from fogpipe.pipeline.graph import Ref
from fogpipe.pipeline.spec import read_spec, spec_from_data

GOOD = """\
fogpipe: 1
inputs: {image: Image, range_map: Range}
params: {beta: 0.2}
stages:
  filled: {use: toy.fill, in: {range_map: range_map}}
  parts: {use: toy.split, in: {range_map: filled}}
  t: {use: toy.transmission, in: {range_map: filled}, with: {extinction: $beta}}
  foggy: {use: toy.paint, in: {image: image, transmission: t}}
outputs: {foggy: foggy, far: parts.far}
"""


def problems(registry, text: str, **overrides) -> list[Problem]:
    with pytest.raises(PipelineError) as caught:
        check(read_spec(dedent(text), "test.yaml", overrides), registry)
    return list(caught.value.problems)


def only(registry, text: str, **overrides) -> Problem:
    found = problems(registry, text, **overrides)
    assert len(found) == 1, found
    return found[0]


def test_a_good_pipeline_becomes_a_graph(registry):
    graph = check(read_spec(GOOD, "test.yaml"), registry)
    assert list(graph.nodes) == ["filled", "parts", "t", "foggy"]
    assert graph.nodes["t"].parameters["extinction"] == 0.2
    assert graph.outputs == {"foggy": Ref("foggy"), "far": Ref("parts", "far")}
    assert graph.kind(Ref("parts", "far")).name == "Mask"


def test_the_order_of_the_file_does_not_matter(registry):
    lines = GOOD.splitlines()
    lines[4:8] = reversed(lines[4:8])
    graph = check(read_spec("\n".join(lines), "test.yaml"), registry)
    assert list(graph.nodes).index("filled") < list(graph.nodes).index("t") < list(graph.nodes).index("foggy")


def test_tolerance_comes_from_the_pipeline_unless_given(registry):
    assert check(read_spec(GOOD + "tolerance: 0.01\n", "t"), registry).nodes["foggy"].parameters["tolerance"] == 0.01
    given = GOOD.replace("transmission: t}}", "transmission: t}, with: {tolerance: 0.3}}")
    assert check(read_spec(given, "t"), registry).nodes["foggy"].parameters["tolerance"] == 0.3


def test_overrides_replace_parameters_of_stages_and_of_the_pipeline(registry):
    graph = check(read_spec(GOOD, "t", {"beta": 0.5, "filled.value": 9}), registry)
    assert graph.nodes["t"].parameters["extinction"] == 0.5
    assert graph.nodes["filled"].parameters["value"] == 9


def test_a_resolved_graph_reads_back_as_the_same_graph(registry):
    graph = check(read_spec(GOOD, "t"), registry)
    again = check(spec_from_data(graph.resolved(), "t"), registry)
    assert again.resolved() == graph.resolved()
    assert again == graph


def test_unknown_stage(registry):
    problem = only(registry, GOOD.replace("toy.fill", "toy.fil"))
    assert (problem.line, problem.column, problem.where) == (5, 12, "stages.filled.use")
    assert 'Did you mean "toy.fill"' in problem.what


def test_unknown_parameter(registry):
    problem = only(registry, GOOD.replace("extinction: $beta", "extinctoin: $beta"))
    assert (problem.line, problem.where) == (7, "stages.t.with.extinctoin")
    assert 'Did you mean "extinction"' in problem.what


def test_unknown_port(registry):
    found = problems(registry, GOOD.replace("{image: image,", "{imge: image,"))
    assert any('Did you mean "image"' in p.what and p.where == "stages.foggy.in.imge" for p in found)


def test_wrong_kind_names_both_kinds_and_what_would_fit(registry):
    problem = only(
        registry, GOOD.replace("transmission: t}}", "transmission: filled}}").replace("outputs: {", "outputs: {t: t, ")
    )
    assert (problem.line, problem.column, problem.where) == (8, 46, "stages.foggy.in.transmission")
    assert problem.what == 'takes Transmission, but "filled" is a Range.\nPorts here that give Transmission: t.'


def test_missing_port(registry):
    found = problems(registry, GOOD.replace("in: {image: image, transmission: t}", "in: {image: image}"))
    assert any(p.where == "stages.foggy.in" and "needs transmission (Transmission)" in p.what for p in found)


def test_parameter_out_of_range(registry):
    problem = only(registry, GOOD.replace("$beta", "-1").replace("params: {beta: 0.2}\n", ""))
    assert problem.where == "stages.t.with.extinction"
    assert "greater than or equal to 0, not -1" in problem.what


def test_parameter_of_wrong_type_and_unknown_choice(registry):
    assert "valid number" in only(registry, GOOD, **{"t.extinction": "thick"}).what
    assert "'exponential' or 'linear'" in only(registry, GOOD, **{"t.law": "cubic"}).what


def test_a_problem_of_an_override_names_the_option(registry):
    assert only(registry, GOOD, **{"t.extinction": -1}).where == "--set t.extinction"
    assert 'no stage "tt"' in only(registry, GOOD, **{"tt.extinction": 1}).what
    assert "Did you mean beta?" in only(registry, GOOD, bta=1).what
    assert "Did you mean t.extinction?" in only(registry, GOOD, extinction=1).what
    assert "Did you mean filled.value?" in only(registry, GOOD, vlue=1).what
    assert "Write it as STAGE.PARAMETER=VALUE." in only(registry, GOOD, xyz=1).what


def test_a_cycle_is_named(registry):
    text = """\
    fogpipe: 1
    stages:
      a: {use: toy.farther, in: {range_map: c}}
      b: {use: toy.farther, in: {range_map: a}}
      c: {use: toy.farther, in: {range_map: b}}
    outputs: {c: c}
    """
    assert "a → b → c → a" in only(registry, text).what


def test_a_stage_that_feeds_itself_is_a_cycle(registry):
    text = "fogpipe: 1\nstages: {a: {use: toy.farther, in: {range_map: a}}}\noutputs: {a: a}\n"
    assert "a → a" in only(registry, text).what


def test_unused_stage_input_and_parameter(registry):
    text = GOOD.replace("stages:", "  extra: Depth\nstages:").replace(
        "inputs: {image: Image, range_map: Range}\nparams: {beta: 0.2}\n",
        "params: {beta: 0.2, gamma: 1}\ninputs:\n  image: Image\n  range_map: Range\n",
    )
    text = text.replace("  t:", "  idle: {use: toy.farther, in: {range_map: filled}}\n  t:")
    assert {p.where for p in problems(registry, text)} == {"stages.idle", "inputs.extra", "params.gamma"}


def test_unknown_output_and_reference(registry):
    assert 'Did you mean "foggy"' in only(registry, GOOD.replace("foggy: foggy,", "foggy: fogy,")).what
    assert (
        'Did you mean "filled"'
        in only(registry, GOOD.replace("range_map: filled}, with", "range_map: filed}, with")).what
    )


def test_a_stage_with_several_outputs_must_be_referred_to_by_port(registry):
    assert "parts.near or parts.far" in only(registry, GOOD.replace("parts.far", "parts")).what
    assert 'Did you mean "parts.far"' in only(registry, GOOD.replace("parts.far", "parts.fr")).what
    assert 'write "t"' in only(registry, GOOD.replace("transmission: t}", "transmission: t.t}")).what


def test_a_parameter_under_in_and_a_port_under_with_are_explained(registry):
    swapped = GOOD.replace("in: {range_map: filled}, with: {extinction: $beta}", "in: {range_map: filled, law: t}")
    assert any("put its value under 'with'" in p.what for p in problems(registry, swapped))
    swapped = GOOD.replace("with: {extinction: $beta}", "with: {extinction: $beta, density: 3}")
    assert "under 'in'" in only(registry, swapped).what


def test_unknown_kind_unknown_dollar_and_supplied_argument(registry):
    assert 'no kind "Imag"' in only(registry, GOOD.replace("image: Image", "image: Imag")).what
    assert 'Did you mean "beta"' in only(registry, GOOD.replace("$beta", "$bta")).what
    noisy = GOOD.replace(
        "toy.paint, in: {image: image, transmission: t}", "toy.noise, in: {image: image}, with: {rng: 1}"
    )
    assert any("supplied by the runner" in p.what for p in problems(registry, noisy))


def test_expectations_need_a_number_and_a_bound(registry):
    text = GOOD.replace("outputs:", "  score: {use: toy.mean, in: {image: foggy}}\noutputs:")
    good = check(read_spec(text + "expect: {score: '>= 0.5'}\n", "t"), registry)
    assert str(good.expectations[0]) == "score >= 0.5"
    assert "single number" in only(registry, GOOD + "expect: {foggy: '>= 1'}\n").what
    assert "not a bound" in only(registry, text + "expect: {score: high}\n").what
    assert "not a bound" not in only(registry, text + "expect: {scor: '> 1'}\n").what


def test_form_faults_are_found_together_with_faults_of_the_graph(registry):
    text = GOOD.replace("outputs:", "ouputs: {}\ncolor: blue\noutputs:").replace("toy.split", "toy.spilt")
    found = problems(registry, text)
    assert {p.where for p in found} == {"ouputs", "color", "stages.parts.use"}


def test_the_version_is_a_number(registry):
    assert "should be 1" in only(registry, GOOD.replace("fogpipe: 1", "fogpipe: true")).what


def test_a_stage_without_use_is_reported_once(registry):
    found = problems(registry, GOOD.replace("use: toy.fill, ", ""))
    assert [(p.where, p.what) for p in found] == [("stages.filled.use", "is missing.")]


@pytest.mark.parametrize(
    "text", ["", "[]", "just text", "fogpipe: 1", "fogpipe: 2\nstages: {}\noutputs: {}", "a: [", "null"]
)
def test_what_is_no_pipeline_at_all_is_refused(registry, text: str):
    assert problems(registry, text)


def test_all_problems_are_reported_in_the_order_of_the_file_with_a_count(registry):
    with pytest.raises(PipelineError) as caught:
        check(read_spec(GOOD.replace("toy.split", "toy.spilt").replace("$beta", "-1"), "mine.yaml"), registry)
    lines = str(caught.value).splitlines()
    assert lines[0].startswith("mine.yaml:3:10  params.beta")
    assert lines[-1] == "3 problems; nothing was run."


@pytest.mark.parametrize(
    "broken",
    ["{ues: toy.fill, in: {range_map: range_map}}", "{use: 3, in: 4, foo: 1}", "{in: {range_map: 3}}", "3", "[1]"],
)
def test_several_faults_in_one_stage_do_not_stop_the_check(registry, broken: str):
    text = GOOD.replace("{use: toy.fill, in: {range_map: range_map}}", broken).replace("$beta", "-1")
    places = {p.where for p in problems(registry, text)}
    assert "stages.t.with.extinction" in places
    assert any(where.startswith("stages.filled") for where in places)


def test_an_override_does_not_hide_a_fault_of_the_file(registry):
    text = GOOD.replace("with: {extinction: $beta}", "with: [1, 2]")
    assert "stages.t.with" in {p.where for p in problems(registry, text, **{"t.extinction": 1})}


def test_two_bounds_on_one_value_both_survive_the_record(registry):
    text = GOOD.replace("outputs: {", "  score: {use: toy.mean, in: {image: foggy}}\noutputs: {mean: score, ")
    graph = check(read_spec(text + "expect: {mean: '> 0', score: '< 4'}\n", "t"), registry)
    again = check(spec_from_data(graph.resolved(), "t"), registry)
    assert [str(e) for e in again.expectations] == ["mean > 0", "score < 4"]


def test_an_input_cannot_bear_the_name_of_an_option_of_run(registry):
    found = problems(registry, GOOD.replace("image: Image", "to: Image").replace("image: image", "image: to"))
    assert any("option of Pipeline.run" in p.what for p in found)


FOG = """\
fogpipe: 1
inputs: {range_map: Range}
stages:
  farthest: {use: range.farthest, in: {range_map: range_map}}
  fog: {use: medium.fog, in: {farthest: farthest}, with: {weather: haze}}
outputs: {extinction: fog.extinction}
"""


def test_parameters_that_do_not_go_together_are_refused_where_the_last_of_them_is_said(registry):
    problem = only(registry, FOG.replace("weather: haze", "weather: haze, visibility: 50"))
    assert (problem.line, problem.where) == (5, "stages.fog.with.visibility")
    assert "give only one of visibility (50.0) and weather (haze)" in problem.what
    problem = only(registry, FOG, **{"fog.extinction": 0.1})
    assert problem.where == "--set fog.extinction"
    assert "The file sets weather; null takes that back, as in --set fog.weather=null." in problem.what
    both = {"fog.weather": None, "fog.extinction": 0.1}
    assert check(read_spec(FOG, "t", both), registry).nodes["fog"].parameters["extinction"] == 0.1
    # A parameter that is not settled is told once.
    assert len(problems(registry, FOG.replace("weather: haze", "weather: $grade, visibility: 50"))) == 1


def test_a_value_of_another_form_is_told_the_form(registry):
    text = "fogpipe: 1\ninputs: {image: Image}\nstages: {light: {use: airlight.estimate, in: {image: image}}}\n"
    text += "outputs: {light: light}\n"
    for value in ([0.7, 0.7], [0.7] * 4, 0.7, [0.7, "red", -1]):
        problem = only(registry, text, **{"light.colour": value})
        assert problem.where == "--set light.colour"
        assert problem.what == f"should be (float ≥ 0, float ≥ 0, float ≥ 0) or none, not {value!r}."
    layer = "fogpipe: 1\ninputs: {image: Image}\nstages: {sky: {use: layers.backdrop, in: {image: image}}}\n"
    problem = only(registry, layer + "outputs: {sky: sky}\n", **{"sky.depth": 2})
    assert problem.what == "should be float ≥ 0, ≤ 1 or close-up or middle or background, not 2."


def test_a_problem_of_an_override_names_the_option_that_gave_it(registry):
    said_by = {"t.extinctoin": "--sweep", "tt.law": "--sample"}
    with pytest.raises(PipelineError) as caught:
        check(read_spec(GOOD, "t", {"t.extinctoin": 1, "tt.law": 2, "t.law": "no"}, said_by), registry)
    assert {p.where for p in caught.value.problems} == {"--sweep t.extinctoin", "--sample tt.law", "--set t.law"}


def test_invalid_yaml_is_the_only_problem_that_is_reported(registry):
    assert only(registry, "stages: [").where == "file"
