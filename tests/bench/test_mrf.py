"""The bench of the field: gaps are certified, and the default solver leads where the issue says so."""

from __future__ import annotations

import pytest

from fogpipe.bench.chart import time_against_error
from fogpipe.bench.mrf import compared, field_with, photograph, solvers
from fogpipe.bench.table import Row


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    fields = {"coffee": field_with(photograph("coffee", (96, 64)), 0.5)}
    return list(compared("coffee", fields, {"coffee": 1.0}, solvers(quick=True)))


def test_no_energy_is_below_the_best_bound(rows):
    assert all(row.error is not None and row.error >= 0 for row in rows)
    assert {row.way.split(" ")[0] for row in rows} == {"chains", "columns", "trws", "icm"}


def test_more_passes_leave_a_smaller_gap_and_chains_the_smallest(rows):
    errors = {row.way: row.error for row in rows}
    assert errors["chains 8"] < errors["chains 2"] < errors["columns"]
    assert errors["chains 8"] == min(errors.values())


def test_the_picture_says_what_the_error_is(rows):
    assert "energy above the best bound" in time_against_error(rows, "coffee")
