"""Prints the tables of explanation/dehazing-experiment.md: ``python docs/dehazing_table.py DIR/dehaze.json``.

The file is what ``fogpipe bench dehaze -o DIR`` writes. A table for each noise has a line for each method, with the
means over scenes at η = 1 / 2 / 3.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

SCORES = {"PSNR": ".1f", "SSIM": ".2f", "CIEDE2000": ".1f", "t error": ".3f"}
THICKNESSES = ("η 1", "η 2", "η 3")


def main(path: Path) -> None:
    """Print every table."""
    means = [row for row in json.loads(path.read_text(encoding="utf-8")) if row["case"].startswith("mean of")]
    found = {(*row["case"].split(", ")[1:], row["way"]): row for row in means}
    for noise in dict.fromkeys(row["case"].split(", ")[2] for row in means):
        print(f"\n{noise}:\n")
        print("| method |", " | ".join(SCORES), "|")
        print("|---" * (1 + len(SCORES)) + "|")
        for way in dict.fromkeys(row["way"] for row in means if row["case"].endswith(f", {noise}")):
            rows = [found[eta, noise, way] for eta in THICKNESSES]
            cells = [cell([row["scores"].get(score) for row in rows], form) for score, form in SCORES.items()]
            print("|", way, "|", " | ".join(cells), "|")


def cell(values: list[float | None], form: str) -> str:
    """The figures at each thickness, or a dash where there are none."""
    return " / ".join("–" if value is None else format(value, form) for value in values)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
