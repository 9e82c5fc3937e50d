"""Frames of a video: when each was taken, and which video it belongs to."""

from __future__ import annotations

import re
from typing import TypedDict


class Moment(TypedDict):
    """What an item knows of its place in a video."""

    values: dict[str, float]
    sequence: str


def frame(sequence: str, name: str, rate: float) -> Moment:
    """The place of a frame whose name ends in its number, taken at ``rate`` frames per second.

    A number that is left out is a frame that was dropped, so the time comes from the number and not from the order.
    """
    digits = re.search(r"(\d+)\D*$", name)
    number = int(digits[1]) if digits else 0
    return {"values": {"frame": number, "time": number / rate}, "sequence": sequence}
