"""What a run reports while it goes on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fogpipe.pipeline.graph import Ref

Status = Literal["ran", "skipped", "cached"]


@dataclass(frozen=True, slots=True)
class StageReport:
    """How one stage went.

    Attributes
    ----------
    status : ran, skipped (the identity on this scene) or cached.
    reason : why it was skipped; empty otherwise.
    seconds : wall time inside the stage.
    """

    name: str
    use: str
    status: Status
    reason: str = ""
    seconds: float = 0.0


class Observer:
    """Hears of a run's events, one at a time; every method may be left as it is."""

    def started(self, name: str) -> None:
        """A stage starts."""

    def finished(self, report: StageReport) -> None:
        """A stage is done, was skipped, or came from the cache."""

    def value(self, ref: Ref, array: np.ndarray) -> None:
        """A stage gave a value. It is freed after its last reader: keep no reference to it."""
