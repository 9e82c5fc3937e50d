"""Connected regions, counted across edges."""

from __future__ import annotations

import numpy as np

from fogpipe.kernels import regions

MASK = np.array([[1, 0, 0, 1], [0, 1, 1, 0], [0, 0, 1, 0]], bool)


def test_corners_do_not_connect():
    labels, count = regions.label(MASK)
    assert count == 3
    np.testing.assert_array_equal(labels, [[1, 0, 0, 2], [0, 3, 3, 0], [0, 0, 3, 0]])
    np.testing.assert_array_equal(regions.areas(labels, count), [1, 1, 3])


def test_row_spans():
    first, after = regions.row_spans(regions.label(MASK)[0])
    np.testing.assert_array_equal(first, [0, 0, 1])
    np.testing.assert_array_equal(after, [1, 1, 3])
    assert regions.row_spans(np.zeros((3, 4), np.int32))[0].size == 0


def test_the_border_is_inside():
    wide = np.zeros((5, 6), bool)
    wide[1:4, 1:5] = True
    inner = np.zeros_like(wide)
    inner[2, 2:4] = True
    np.testing.assert_array_equal(regions.border(wide, ~wide), wide & ~inner)
    assert not regions.border(wide, np.zeros_like(wide)).any()


def test_border_pairs_are_all_edges_between_two_masks():
    inside, outside = regions.border_pairs(MASK, ~MASK)
    edges = set(zip(inside.tolist(), outside.tolist(), strict=True))
    assert edges == {(0, 1), (0, 4), (3, 2), (3, 7), (5, 1), (5, 4), (5, 9), (6, 2), (6, 7), (10, 9), (10, 11)}
    assert len(inside) == len(edges)
    assert regions.border_pairs(MASK[:1, :1], ~MASK[:1, :1])[0].size == 0
