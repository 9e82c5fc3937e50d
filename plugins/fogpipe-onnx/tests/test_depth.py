"""Depth by a network that is made here: the mean of the three channels, times a factor."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

onnx = pytest.importorskip("onnx", reason="the tests make their model with the package onnx")
pytest.importorskip("onnxruntime", reason="the stages run models with the package onnxruntime")

from fogpipe.kernels.srgb import linear_from_srgb  # noqa: E402
from fogpipe.testing import check_stage  # noqa: E402

from fogpipe_onnx.depth import metric_depth, relative_depth  # noqa: E402

AS_IT_IS = {"encoding": "display", "mean": (0.0, 0.0, 0.0), "std": (1.0, 1.0, 1.0), "multiple": 1}


def save(path: Path, nodes: list, shape: tuple, output: tuple) -> str:
    """Write a model that takes ``x`` and gives ``y``."""
    value = onnx.helper.make_tensor_value_info
    graph = onnx.helper.make_graph(
        nodes,
        "tiny",
        [value("x", onnx.TensorProto.FLOAT, shape)],
        [value("y", onnx.TensorProto.FLOAT, output)],
        [onnx.helper.make_tensor("factor", onnx.TensorProto.FLOAT, [], [3.0])],
    )
    opset = [onnx.helper.make_opsetid("", 17)]
    onnx.save(onnx.helper.make_model(graph, opset_imports=opset, ir_version=10), path)
    return str(path)


def mean_of_channels() -> list:
    mean = onnx.helper.make_node("ReduceMean", ["x"], ["mean"], axes=[1], keepdims=0)
    return [mean, onnx.helper.make_node("Mul", ["mean", "factor"], ["y"])]


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("models") / "grey.onnx"
    return save(path, mean_of_channels(), (1, 3, "rows", "columns"), (1, "rows", "columns"))


@pytest.fixture
def photo() -> np.ndarray:
    return np.random.default_rng(5).random((24, 36, 3)).astype(np.float32)


@pytest.mark.parametrize("stage", [relative_depth, metric_depth])
def test_it_keeps_the_promises_of_a_stage(stage, model: str):
    check_stage(stage, parameters={"model": model, "side": 8})


def test_a_metric_network_gives_metres(model: str, photo: np.ndarray):
    depth = metric_depth(photo, model=model, side=24, unit=2.0, **AS_IT_IS)
    # The mean of three numbers in float32, in another order: a few units in the last place.
    np.testing.assert_allclose(depth, 6 * photo.mean(axis=2), rtol=1e-6)


def test_what_is_beyond_far_is_sky(model: str, photo: np.ndarray):
    depth = metric_depth(photo, model=model, side=24, far=1.5, **AS_IT_IS)
    np.testing.assert_array_equal(np.isinf(depth), 3 * photo.mean(axis=2, dtype=np.float32) >= 1.5)


@pytest.mark.parametrize(("output", "sign"), [("inverse-depth", -1), ("depth", 1)])
def test_a_relative_network_gives_an_order(model: str, photo: np.ndarray, output: Any, sign: int):
    depth = relative_depth(photo, model=model, side=24, output=output, clip=0, **AS_IT_IS)
    grey = sign * photo.mean(axis=2)
    # As above, after a division by a spread of about 0.7.
    np.testing.assert_allclose(depth, (grey - grey.min()) / np.ptp(grey), atol=1e-6)


def test_the_network_sees_normalised_display_values(model: str, photo: np.ndarray):
    linear = linear_from_srgb(photo)
    given = {"model": model, "side": 24, "multiple": 1, "mean": (0.1, 0.2, 0.3), "std": (0.5, 0.25, 0.2)}
    seen = (photo - np.array(given["mean"])) / np.array(given["std"])
    depth = metric_depth(linear, **given)
    # The curve there and back is good to 1e-6, times the largest 1/std of 5.
    np.testing.assert_allclose(depth, np.maximum(3 * seen.mean(axis=2), 0), atol=2e-5)


def test_sides_are_multiples_and_keep_the_aspect(tmp_path: Path):
    """A network that gives its own size, as height + width / 1000 in every pixel."""
    node = onnx.helper.make_node
    nodes = [
        node("ReduceMean", ["x"], ["mean"], axes=[1], keepdims=0),
        node("Sub", ["mean", "mean"], ["zero"]),
        node("Shape", ["mean"], ["sizes"]),
        node("Cast", ["sizes"], ["numbers"], to=onnx.TensorProto.FLOAT),
        node("Split", ["numbers"], ["one", "rows", "columns"], axis=0),
        node("Add", ["zero", "rows"], ["y"]),
    ]
    model = save(tmp_path / "size.onnx", nodes, (1, 3, "rows", "columns"), (1, "rows", "columns"))
    depth = metric_depth(np.zeros((30, 90, 3), np.float32), model=model, side=50, multiple=14)
    assert depth.max() == 56  # the multiple of 14 nearest to 50


def test_a_fixed_size_of_the_model_wins(tmp_path: Path, photo: np.ndarray):
    model = save(tmp_path / "fixed.onnx", mean_of_channels(), (1, 3, 12, 18), (1, 12, 18))
    depth = metric_depth(photo, model=model, side=500, **AS_IT_IS)
    assert depth.shape == (24, 36)
    assert depth.mean() == pytest.approx(3 * photo.mean(), rel=0.02)  # halved and doubled again: the borders differ


@pytest.mark.parametrize("tiles", [2, 3])
def test_tiles_of_a_network_without_context_change_nothing(model: str, tiles: int):
    y, x = np.mgrid[:40, :60] / np.float32(60)
    photo = np.repeat(((x + y) / 2)[..., None], 3, axis=2).astype(np.float32)
    whole = relative_depth(photo, model=model, side=40, clip=0, **AS_IT_IS)
    tiled = relative_depth(photo, model=model, side=40, clip=0, tiles=tiles, **AS_IT_IS)
    # Each tile is enlarged to the side that the network asks for, and reduced again: half a pixel of a ramp of 1/60.
    np.testing.assert_allclose(tiled, whole, atol=0.01)


def test_a_constant_answer_is_halfway(model: str):
    depth = relative_depth(np.full((5, 7, 3), 0.3, np.float32), model=model, side=5)
    assert (depth == 0.5).all()


def test_a_missing_file_is_told(photo: np.ndarray):
    with pytest.raises(ValueError, match=r'no model file "nowhere\.onnx"'):
        relative_depth(photo, model="nowhere.onnx")


def test_a_file_that_is_no_model_is_told(tmp_path: Path, photo: np.ndarray):
    (tmp_path / "text.onnx").write_text("not a model")
    with pytest.raises(ValueError, match=r"text\.onnx is not an ONNX model"):
        relative_depth(photo, model=str(tmp_path / "text.onnx"))


def test_the_digest_tells_one_model_from_another(model: str, photo: np.ndarray):
    digest = hashlib.sha256(Path(model).read_bytes()).hexdigest()
    relative_depth(photo, model=model, sha256=digest, side=8)
    with pytest.raises(ValueError, match="it is another model"):
        relative_depth(photo, model=model, sha256="0" * 64, side=8)


def test_a_network_that_gives_no_map_is_told(tmp_path: Path, photo: np.ndarray):
    nodes = [onnx.helper.make_node("Mul", ["x", "factor"], ["y"])]
    model = save(tmp_path / "colour.onnx", nodes, (1, 3, "rows", "columns"), (1, 3, "rows", "columns"))
    with pytest.raises(ValueError, match="where a map is wanted"):
        relative_depth(photo, model=model, side=8)


def test_a_network_that_takes_no_picture_is_told(tmp_path: Path, photo: np.ndarray):
    nodes = [onnx.helper.make_node("Mul", ["x", "factor"], ["y"])]
    model = save(tmp_path / "vector.onnx", nodes, (1, 7), (1, 7))
    with pytest.raises(ValueError, match="must take one picture"):
        relative_depth(photo, model=model)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_image_that_is_not_finite_is_refused(model: str, value: float):
    with pytest.raises(ValueError, match="NaN or infinite"):
        relative_depth(np.full((4, 4, 3), value, np.float32), model=model)
