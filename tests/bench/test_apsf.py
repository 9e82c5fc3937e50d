"""The bench of point spread functions, and curves drawn as SVG."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from fogpipe.bench.apsf import TOLERANCES, against_converged, against_direct, shapes
from fogpipe.bench.blur import premultiplied
from fogpipe.bench.chart import curves


def test_the_table_beats_the_series_by_far():
    rows = {row.way: row for row in shapes(0.9, 2.0, 300_000)}
    assert rows["measured"].error < 0.02 < 0.5 < rows["series"].error
    assert rows["measured"].error < rows["gaussian"].error < rows["series"].error


def test_the_series_has_no_row_where_it_diverges():
    assert {row.way for row in shapes(0.9, 0.5, 100_000)} == {"measured", "gaussian"}
    assert {row.way for row in shapes(0.0, 0.5, 100_000)} == {"measured"}


def test_every_way_keeps_its_tolerance_and_has_a_time():
    layer, ratio = premultiplied("outdoor", 70, 100)
    yardstick, *rows = against_converged("street", layer, 4 * ratio, TOLERANCES[::2], repeats=1)
    assert yardstick.error is None
    assert len(rows) == 2 * len(TOLERANCES[::2])
    for row in rows:
        assert row.seconds > 0
        assert 0 < row.error <= float(row.way.split()[1])


def test_the_direct_sum_agrees():
    for row in against_direct(*premultiplied("motorcycle", 14, 20)):
        assert row.error <= float(row.way.split()[1])
        assert row.ratio < 1


@pytest.fixture(scope="module")
def drawing() -> ElementTree.Element:
    angles = np.linspace(0, 60, 50)
    lines = {"one": np.exp(-angles / 5), "one *": np.exp(-angles / 50), "two": 0.5 * np.exp(-angles / 9)}
    return ElementTree.fromstring(curves("title", ("angle", angles), "radiance", lines, decades=3))


def test_curves_stay_inside_their_frame(drawing):
    drawn = [element for element in drawing if element.tag.endswith("polyline")]
    for element in drawn:
        for point in element.attrib["points"].split():
            x, y = map(float, point.split(","))
            assert 70 <= x <= 650
            assert 70 <= y <= 410


def test_a_dashed_curve_has_the_colour_of_the_one_before_and_no_name_of_its_own(drawing):
    one, dashed, two = [e.attrib for e in drawing if e.tag.endswith("polyline") and e.attrib["stroke"] != "#ddd"]
    assert one["stroke"] == dashed["stroke"] != two["stroke"]
    assert one["stroke-dasharray"] == "none" != dashed["stroke-dasharray"]
    words = [element.text for element in drawing if element.tag.endswith("text")]
    assert {"title", "angle", "radiance", "one", "two", "10", "0.01"} <= set(words)
    assert "one *" not in words
