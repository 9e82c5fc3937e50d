"""Times several ways of doing a thing side by side."""

from __future__ import annotations

import random
import statistics
import time
from collections.abc import Callable, Mapping


def alternating(ways: Mapping[str, Callable[[], object]], repeats: int = 7) -> dict[str, float]:
    """Median seconds of each way.

    All ways are called once to warm up (that is when kernels are compiled), then each once in every of ``repeats``
    rounds, so that a machine that slows down or speeds up does so for all of them. Each round has an order of its own:
    a way that always follows one that sweeps the caches would pay for it.
    """
    for call in ways.values():
        call()
    taken: dict[str, list[float]] = {name: [] for name in ways}
    order = random.Random(0)
    for _ in range(repeats):
        for name in order.sample(list(ways), len(ways)):
            started = time.perf_counter()
            ways[name]()
            taken[name].append(time.perf_counter() - started)
    return {name: statistics.median(times) for name, times in taken.items()}
