"""Masks that people paint: one file per layer, labels of one picture, pages of a layered TIFF."""

from __future__ import annotations

import numpy as np
import pytest
import tifffile
from PIL import Image

from fogpipe.errors import InputError
from fogpipe.io.exr import write_channels
from fogpipe.io.masks import read_mask
from fogpipe.pipeline.plan import make_plan
from fogpipe.runtime.inputs import Request, inputs_from_request

TREE = np.zeros((5, 7), bool)
TREE[1:4, 2:5] = True
HILL = np.zeros((5, 7), bool)
HILL[3:] = True


def painted(mask, alpha=False):
    grey = np.where(mask, np.uint8(255), np.uint8(0))
    if not alpha:
        return Image.fromarray(grey)
    return Image.fromarray(np.dstack([np.full((*mask.shape, 3), 40, np.uint8), grey]))  # dark paint on nothing


@pytest.fixture
def layered(tmp_path):
    """A TIFF of two pages with names, as painting programs write it."""
    path = tmp_path / "layers.tif"
    with tifffile.TiffWriter(path) as file:
        for mask, name in ((TREE, "tree"), (HILL, "hill")):
            samples = np.asarray(painted(mask, alpha=True))
            file.write(samples, extrasamples=["unassalpha"], extratags=[(285, "s", 0, name, True)], metadata=None)
    return path


# Dark paint is a mask by its alpha alone.
@pytest.mark.parametrize(("alpha", "mode"), [(False, "own"), (False, "RGB"), (True, "own")])
def test_a_mask_is_what_is_opaque_or_else_what_is_bright(tmp_path, alpha, mode):
    picture = painted(TREE, alpha)
    (picture if mode == "own" else picture.convert(mode)).save(tmp_path / "tree.png")
    np.testing.assert_array_equal(read_mask(str(tmp_path / "tree.png")), TREE)


@pytest.mark.parametrize("mode", ["L", "P"])
def test_labels_of_one_picture_are_masks(tmp_path, mode):
    labels = np.where(TREE, np.uint8(2), HILL.astype(np.uint8))
    image = Image.fromarray(labels)
    if mode == "P":
        image = Image.frombytes("P", labels.shape[::-1], labels.tobytes())
        image.putpalette([0, 0, 0, 250, 10, 10, 10, 250, 10])
    image.save(tmp_path / "labels.png")
    np.testing.assert_array_equal(read_mask(f"{tmp_path}/labels.png#2"), TREE)
    np.testing.assert_array_equal(read_mask(f"{tmp_path}/labels.png#1"), HILL & ~TREE)


def test_labels_of_16_bits(tmp_path):
    Image.fromarray(np.where(TREE, np.uint16(40000), np.uint16(0))).save(tmp_path / "labels.png")
    np.testing.assert_array_equal(read_mask(f"{tmp_path}/labels.png#40000"), TREE)


def test_pages_of_a_tiff_are_masks_by_number(layered):
    np.testing.assert_array_equal(read_mask(f"{layered}#1"), TREE)
    np.testing.assert_array_equal(read_mask(f"{layered}#2"), HILL)


def test_pages_of_a_tiff_are_masks_by_name(layered):
    np.testing.assert_array_equal(read_mask(f"{layered}#tree"), TREE)
    np.testing.assert_array_equal(read_mask(f"{layered}#hill"), HILL)


@pytest.fixture
def rendered(tmp_path):
    """An EXR as renderers write it: a tree by its alpha, a mask of its own for the hill, and depth."""
    path = tmp_path / "render.exr"
    grey = np.full((5, 7), 0.2, np.float16)
    layers = {"A": TREE.astype(np.float16), "hill.mask": HILL.astype(np.float32), "Z": 9 + grey}
    path.write_bytes(write_channels({"R": grey, "G": grey, "B": grey, **layers}))
    return path


def test_what_an_exr_shows_is_a_mask_and_so_are_its_channels_by_name(rendered):
    np.testing.assert_array_equal(read_mask(str(rendered)), TREE)
    np.testing.assert_array_equal(read_mask(f"{rendered}#A"), TREE)
    np.testing.assert_array_equal(read_mask(f"{rendered}#hill.mask"), HILL)
    with pytest.raises(InputError, match=r"render.exr#tree: has no channel tree. It has A, B, G, R, Z, hill.mask"):
        read_mask(f"{rendered}#tree")


def test_an_exr_that_is_opaque_is_no_mask(tmp_path):
    grey = np.full((5, 7), 0.2, np.float16)
    (tmp_path / "opaque.exr").write_bytes(write_channels({"R": grey, "G": grey, "B": grey, "A": np.ones_like(grey)}))
    with pytest.raises(InputError, match=r"opaque.exr: has no channel Y. It has A, B, G, R"):
        read_mask(f"{tmp_path}/opaque.exr")


def test_what_is_not_there_is_told_with_what_is(tmp_path, layered):
    Image.fromarray(HILL.astype(np.uint8)).save(tmp_path / "labels.png")
    with pytest.raises(InputError, match=r"labels.png#7: it has no label 7. It has 0, 1\."):
        read_mask(f"{tmp_path}/labels.png#7")
    with pytest.raises(InputError, match=r"layers.tif#3: it has no page 3. It has 1 tree, 2 hill"):
        read_mask(f"{layered}#3")
    with pytest.raises(InputError, match="is no label: give a whole number"):
        read_mask(f"{tmp_path}/labels.png#tree")


def test_colours_are_no_labels(tmp_path):
    painted(TREE).convert("RGB").save(tmp_path / "labels.png")
    with pytest.raises(InputError, match="it has no labels, but colours"):
        read_mask(f"{tmp_path}/labels.png#1")


@pytest.mark.parametrize("content", [b"II*\0damaged", b"\x89PNG\r\n\x1a\ndamaged", b"text"])
def test_a_damaged_file_is_one_clear_error(tmp_path, content):
    (tmp_path / "labels.png").write_bytes(content)
    with pytest.raises(InputError, match=r"labels\.png"):
        read_mask(f"{tmp_path}/labels.png#1")


def test_a_mask_of_another_size_is_refused_at_the_door(tmp_path, build):
    painted(TREE).save(tmp_path / "tree.png")
    Image.fromarray(np.zeros((6, 7, 3), np.uint8)).save(tmp_path / "image.png")
    graph = build("""
        inputs: {image: Image, tree: Mask}
        stages:
          far: {use: layers.backdrop, in: {image: image}}
          depth: {use: layers.flat, in: {below: far, mask: tree}}
        outputs: {depth: depth}
    """)
    files = {"image": str(tmp_path / "image.png"), "tree": str(tmp_path / "tree.png")}
    with pytest.raises(InputError, match=r"tree.*has shape \(5, 7\).*\(6, 7, 3\).* Export them at one size"):
        inputs_from_request(make_plan(graph), Request(files=files))


def test_a_record_keeps_the_part_of_the_file(layered, monkeypatch):
    monkeypatch.chdir(layered.parent)
    data = Request(files={"tree": "layers.tif#tree"}).to_data()
    assert data["files"]["tree"] == f"{layered.resolve()}#tree"
