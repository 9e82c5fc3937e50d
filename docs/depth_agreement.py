"""Prints how well depths from one photograph order a scene: ``python docs/depth_agreement.py [FOLDER]``.

The scenes are the samples and, with the folder of real images that the tests use, its frames with measured depth.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fogpipe.bench.photo import guesses
from fogpipe.io.scenes import Scene, open_scene, scene_from_files
from fogpipe.stages.depth import agreement

SAMPLES = ("motorcycle", *(f"outdoor:{seed}:640x400" for seed in range(1, 7)))
FRAMES = {
    "KITTI street": ("kitti/rgb.png", "kitti/depth.png", "kitti"),
    "Kinect room": ("kinect/color.jpg", "kinect/depth_mm.png", "millimetres"),
    "TUM desk": ("kinect/tum_color.png", "kinect/tum_depth.png", "tum"),
    "SUN corridor": ("kinect/sun_color.jpg", "kinect/sun_depth.png", "sun"),
    "beachball": ("exr/beachball.exr", "exr/beachball.exr", "exr-z"),
}


def scenes(folder: Path | None) -> Iterator[tuple[str, Scene]]:
    """All scenes with true range, by name."""
    for name in SAMPLES:
        yield name, open_scene(f"sample:{name}")
    for name, (image, depth, encoding) in FRAMES.items() if folder else ():
        yield name, scene_from_files(folder / image, folder / depth, encoding=encoding)


def main(folder: Path | None) -> None:
    """A Markdown table, a line per scene: Spearman, and the share of pairs in the true order."""
    ways = guesses()
    print(f"| scene | {' | '.join(ways)} |", f"|---|{'---|' * len(ways)}", sep="\n")
    scores = []
    for name, scene in scenes(folder):
        values = scene.load("srgb").values
        true_range = np.where(values["range_map"] > 0, values["range_map"], np.nan)
        step = max(1, values["image"].shape[1] // 640)
        image, true_range = np.clip(values["image"][::step, ::step], 0, 1), true_range[::step, ::step]
        found = [agreement(true_range, guess(image), rng=np.random.default_rng(0)) for guess in ways.values()]
        scores.append(found)
        print(f"| {name} | {' | '.join(f'{s:.2f}, {p:.2f}' for s, p in found)} |", flush=True)
    means = np.array(scores, float).mean(axis=0)
    print(f"| mean | {' | '.join(f'{s:.2f}, {p:.2f}' for s, p in means)} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
