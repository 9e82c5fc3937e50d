"""Makes the pictures of the README and the docs: ``python docs/pictures.py``."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

import fogpipe
from fogpipe.bench.dehaze import draw
from fogpipe.io.images import write_image
from fogpipe.io.scenes import open_scene

FOLDER = Path(__file__).parent / "pictures"


def outdoor(visibilities: tuple[float, ...] = (300, 150, 60)) -> None:
    """The street in clear air and in ever thicker haze, two by two."""
    values = open_scene("sample:outdoor").load("linear").values
    inputs = {name: values[name] for name in ("image", "range_map")}
    pictures = [np.asarray(inputs["image"])]
    for visibility in visibilities:
        pipeline = fogpipe.load("hansard2019", set={"fog.visibility": visibility})
        pictures.append(pipeline.run(to=["hazy"], **inputs)["hazy"])
    rows = [np.hstack(pictures[:2]), np.hstack(pictures[2:])]
    write_image(FOLDER / "outdoor.jpg", cv2.resize(np.vstack(rows), (1200, 750), interpolation=cv2.INTER_AREA))


def dehazing() -> None:
    """A hazy, noisy street and what every method makes of it, as `fogpipe bench dehaze` draws it."""
    with TemporaryDirectory() as folder:
        draw(Path(folder), quick=True)
        sheet = cv2.imread(str(Path(folder) / "dehaze-outdoor-1.png"))
    cv2.imwrite(str(FOLDER / "dehazing-experiment.jpg"), sheet, [cv2.IMWRITE_JPEG_QUALITY, 75])


if __name__ == "__main__":
    outdoor()
    dehazing()
