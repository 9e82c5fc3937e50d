"""A proof sheet is one readable page, whatever the run was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fogpipe.errors import OutputError
from fogpipe.io.sheet import Tile, tile, write_sheet
from fogpipe.ports import known_kinds

KINDS = known_kinds()


def tiles(count: int, height: int = 60, width: int = 90) -> list[Tile]:
    rng = np.random.default_rng(count)
    return [tile(f"stage{i}", KINDS["Transmission"], rng.random((height, width)), "linear") for i in range(count)]


def page(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        assert image.format == "PNG"
        return np.asarray(image.convert("RGB"))


def is_on(pixels: np.ndarray, picture: np.ndarray) -> bool:
    height, width = picture.shape[:2]
    starts = np.argwhere((pixels == picture[0, 0]).all(axis=2))
    return any(np.array_equal(pixels[y : y + height, x : x + width], picture) for y, x in starts)


def test_every_picture_is_on_the_page(tmp_path):
    shown = tiles(5)
    write_sheet(tmp_path / "sheet.png", "Five maps", shown)
    for entry in shown:
        assert entry.picture is not None
        assert is_on(page(tmp_path / "sheet.png"), entry.picture)


def test_the_page_grows_with_its_content(tmp_path):
    sizes = []
    for count in (1, 4, 9, 30):
        write_sheet(tmp_path / "sheet.png", "Maps", tiles(count))
        height, width, _ = page(tmp_path / "sheet.png").shape
        sizes.append(height * width)
    assert sizes == sorted(set(sizes))


@pytest.mark.parametrize(
    "shown",
    [
        [],
        [tile("psnr", KINDS["Number"], np.array(np.inf), "linear")],
        [tile("one", KINDS["Image"], np.ones((1, 1, 3), np.float32), "linear")],
        [tile("n" * 500, KINDS["Range"], np.full((3, 500), np.nan), "linear")],
    ],
)
def test_odd_runs_have_a_sheet_too(tmp_path, shown):
    write_sheet(tmp_path / "sheet.png", "A title that is very much longer than the page is wide " * 5, shown)
    assert page(tmp_path / "sheet.png").shape[1] < 1000


def test_letters_that_the_font_lacks_are_spelled_out(tmp_path):
    for name, title in (("plain", "Brouillard -> epais ?"), ("fancy", "Brouillard → épais 霧")):
        write_sheet(tmp_path / f"{name}.png", title, [])
    np.testing.assert_array_equal(page(tmp_path / "plain.png"), page(tmp_path / "fancy.png"))


def test_the_same_tiles_give_the_same_bytes(tmp_path):
    for name in ("a.png", "b.png"):
        write_sheet(tmp_path / name, "Twice", tiles(3))
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_sheet_that_cannot_be_written_is_an_output_error(tmp_path):
    with pytest.raises(OutputError, match="Create the folder first"):
        write_sheet(tmp_path / "nowhere" / "sheet.png", "Lost", tiles(1))
