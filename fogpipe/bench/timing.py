"""Times several ways of doing a thing side by side."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping


def alternating(ways: Mapping[str, Callable[[], object]], repeats: int = 7) -> dict[str, float]:
    """Median seconds of each way.

    All ways are called once to warm up (that is when kernels are compiled), then in turn ``repeats`` times, so
    that a machine that slows down or speeds up does so for all of them.
    """
    for call in ways.values():
        call()
    taken: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, call in ways.items():
            started = time.perf_counter()
            call()
            taken[name].append(time.perf_counter() - started)
    return {name: statistics.median(times) for name, times in taken.items()}
