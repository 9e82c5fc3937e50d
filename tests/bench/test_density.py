"""The density bench: what its rows say."""

from __future__ import annotations

from fogpipe.bench import subject
from fogpipe.bench.density import BLUR, _along_rays


def test_shorter_steps_have_smaller_errors():
    rows = list(_along_rays("64x40", repeats=1))
    errors = [row.error for row in rows]
    assert errors == sorted(errors, reverse=True)
    assert 0 < errors[-1] < 1e-3
    assert all(row.yardstick == BLUR and row.ratio > 0 for row in rows)


def test_the_command_line_finds_it():
    assert subject("density").__module__ == "fogpipe.bench.density"
