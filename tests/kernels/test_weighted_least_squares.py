"""Smoothing by weights on edges: the solution of the linear system, whatever the weights and the size."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import spsolve

from fogpipe.kernels.bands import set_threads, threads
from fogpipe.kernels.dehazing.weighted_least_squares import smooth


def weights(height: int, width: int, contrast: float) -> tuple[np.ndarray, np.ndarray]:
    """Random weights over many orders of magnitude, none beyond the last column and row."""
    rng = np.random.default_rng(1)
    east, south = (np.exp(rng.uniform(-contrast, contrast, (height, width))).astype(np.float32) for _ in range(2))
    east[:, -1] = 0
    south[-1] = 0
    return east, south


def solved(plane: np.ndarray, east: np.ndarray, south: np.ndarray) -> np.ndarray:
    """The system by a direct sparse solver."""
    height, width = plane.shape
    number = np.arange(plane.size).reshape(height, width)
    first = np.concatenate([number[:, :-1].ravel(), number[:-1].ravel()])
    other = np.concatenate([number[:, 1:].ravel(), number[1:].ravel()])
    weight = np.concatenate([east[:, :-1].ravel(), south[:-1].ravel()]).astype(np.float64)
    flow = csr_array((weight, (first, other)), shape=(plane.size,) * 2)
    flow = flow + flow.T
    matrix = diags_array(1 + np.asarray(flow.sum(axis=1)).ravel()) - flow
    return spsolve(matrix.tocsc(), plane.ravel().astype(np.float64)).reshape(plane.shape)


@pytest.mark.parametrize("shape", [(1, 1), (1, 11), (9, 1), (16, 16), (37, 53)])
@pytest.mark.parametrize("contrast", [0.5, 5.0])
def test_it_is_the_solution_of_the_system(shape, contrast):
    planes = np.random.default_rng(0).random((3, *shape), dtype=np.float32)
    east, south = weights(*shape, contrast)
    got = smooth(planes, planes, east, south, tolerance=1e-6, most=200)
    for plane, one in zip(planes, got, strict=True):
        # The smallest eigenvalue is 1: the error is at most the residual, plus float32 rounding of weights up to e⁵.
        np.testing.assert_allclose(one, solved(plane, east, south), atol=2e-5)


def test_no_light_is_lost():
    planes = np.random.default_rng(0).random((2, 40, 31), dtype=np.float32)
    got = smooth(planes, planes, *weights(40, 31, 3.0), tolerance=1e-5)
    np.testing.assert_allclose(got.mean(axis=(1, 2)), planes.mean(axis=(1, 2)), atol=1e-5)  # that residual


def test_few_steps_are_enough_at_any_size():
    error = []
    for size in (32, 256):
        planes = np.random.default_rng(0).random((1, size, size), dtype=np.float32)
        east, south = weights(size, size, 4.0)
        wanted = smooth(planes, planes, east, south, tolerance=1e-6, most=200)
        error.append(np.std(smooth(planes, planes, east, south, tolerance=0, most=12) - wanted))
    # The planes vary by 0.3. The error hardly grows with the size, as it would without coarser grids.
    assert max(error) < 5e-3
    assert error[1] < 3 * error[0]


def test_one_and_two_threads_give_the_same_bytes():
    planes = np.random.default_rng(0).random((3, 200, 210), dtype=np.float32)
    before = threads()
    try:
        runs = []
        for count in (1, 2):
            set_threads(count)
            runs.append(smooth(planes, planes, *weights(200, 210, 4.0), tolerance=1e-3))
    finally:
        set_threads(before)
    assert runs[0].tobytes() == runs[1].tobytes()
