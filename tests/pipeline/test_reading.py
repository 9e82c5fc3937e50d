"""YAML with the place of every item."""

from __future__ import annotations

import pytest

from fogpipe.pipeline.reading import read_value, read_yaml


def test_places_are_lines_and_columns_of_keys_from_one():
    document = read_yaml("a: 1\nb:\n  c: [x, y]\n")
    assert document.data == {"a": 1, "b": {"c": ["x", "y"]}}
    assert document.place(("b", "c")) == (3, 3)
    assert document.place(("b", "c", 1)) == (3, 10)


def test_the_place_of_something_missing_is_that_of_its_parent():
    assert read_yaml("a:\n  b: 1\n").place(("a", "nothing", "deeper")) == (1, 1)


def test_a_doubled_key_is_a_problem_and_not_silently_overwritten():
    document = read_yaml("a: 1\na: 2\n")
    assert [(p.line, p.column, p.where) for p in document.problems] == [(2, 1, "a")]


@pytest.mark.parametrize("text", ["a: [1", "a: b: c", "\t- x", "a: 'open", "&a [*a, *b]"])
def test_broken_yaml_is_one_problem_with_a_place(text: str):
    problems = read_yaml(text).problems
    assert len(problems) == 1
    assert problems[0].line >= 1


@pytest.mark.parametrize("text", ["", "# nothing\n", "a: \x00"])
def test_empty_or_unprintable_text_is_a_problem(text: str):
    assert len(read_yaml(text).problems) == 1


def test_aliases_that_grow_without_end_are_refused():
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
    assert "more than" in read_yaml("\n".join(lines)).problems[0].what


def test_deep_nesting_is_refused():
    assert read_yaml("[" * 5000 + "]" * 5000).problems


def test_numbers_are_read_as_yaml_1_2_reads_them():
    assert read_value("1e-3") == 1e-3
    assert read_value("-2.5E+2") == -250.0
    assert read_value("1e") == "1e"
    assert read_value("[0.1, 0.2]") == [0.1, 0.2]


@pytest.mark.parametrize("text", ["1:30", "yes", "1_000", "2020-01-01"])
def test_what_only_yaml_1_1_takes_for_something_else_is_a_text(text: str):
    assert read_value(text) == text


def test_infinity_null_and_truth():
    assert read_value("[.inf, -.inf, null, ~, true, False, 0x10, -3]") == [
        float("inf"),
        float("-inf"),
        None,
        None,
        True,
        False,
        16,
        -3,
    ]
