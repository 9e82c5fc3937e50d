"""The door: files, scenes and arrays become the checked inputs of a plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fogpipe.errors import InputError, suggestion
from fogpipe.pipeline.plan import Plan
from fogpipe.ports import Kind

_DISTANCES = ("Range", "Depth", "RelativeDepth")


@dataclass(frozen=True)
class Request:
    """Where the inputs of a run come from, as plain data that a record can repeat.

    Attributes
    ----------
    scene : ``sample:NAME`` or a scene file.
    files : a file (or, for a single number, its text) for each input by name; they replace the scene's.
    depth : name of the encoding of depth files.
    camera : file with the camera's intrinsics.
    """

    scene: str | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    depth: str | None = None
    camera: str | None = None

    def to_data(self) -> dict[str, Any]:
        """Plain data with absolute paths."""
        data = asdict(self)
        data["files"] = {name: _absolute(text) for name, text in self.files.items()}
        data["camera"] = self.camera and _absolute(self.camera)
        if self.scene and not self.scene.startswith("sample:"):
            data["scene"] = _absolute(self.scene)
        return data


@dataclass(frozen=True)
class Inputs:
    """The inputs of a run.

    Attributes
    ----------
    values : an array for each input, checked against its kind.
    sources : for each input, the file or sample it came from.
    alpha : opacity of the input picture, which the output pictures get back; or None.
    notes : what was assumed on the way in.
    """

    values: dict[str, np.ndarray]
    sources: dict[str, str] = field(default_factory=dict)
    alpha: np.ndarray | None = None
    notes: tuple[str, ...] = ()


def inputs_from_request(plan: Plan, request: Request) -> Inputs:
    """Read the inputs that a plan needs from files and a scene.

    Raises
    ------
    InputError
        If a file cannot be used, an input is missing or not known, or sizes disagree.
    """
    for name in request.files:
        if name not in plan.graph.inputs:
            hint = suggestion(name, plan.graph.inputs)
            raise InputError(f'-i {name}: {plan.graph.source} has no input "{name}".{hint}')
    values: dict[str, np.ndarray] = {}
    sources: dict[str, str] = {}
    notes: list[str] = []
    alpha = None
    if request.scene:
        from fogpipe.io.scenes import open_scene

        scene = open_scene(request.scene).load(plan.graph.color)
        values, sources, alpha = dict(scene.values), dict(scene.sources), scene.alpha
        notes += scene.notes
    for name in plan.inputs:
        if name in request.files:
            values[name], opacity, said = _read(plan, name, request)
            alpha = alpha if opacity is None else opacity
            sources[name] = request.files[name]
            notes += said
    values = {name: values[name] for name in plan.inputs if name in values}
    return Inputs(checked(plan, values, given_by="file"), sources, alpha, tuple(notes))


def inputs_from_arrays(plan: Plan, arrays: Mapping[str, Any]) -> Inputs:
    """Take the inputs that a plan needs from arrays or numbers.

    Pictures of integers are sRGB display values and are brought to the pipeline's working space;
    pictures of floats are working values already.
    """
    for name in arrays:
        if name not in plan.graph.inputs:
            raise InputError(f'{plan.graph.source} has no input "{name}".{suggestion(name, plan.graph.inputs)}')
    values: dict[str, np.ndarray] = {}
    alpha = None
    for name in plan.inputs:
        if name not in arrays:
            continue
        if plan.graph.inputs[name].name == "Image":
            from fogpipe.io.images import picture_from_array

            try:
                picture = picture_from_array(np.asarray(arrays[name]), color=plan.graph.color)
            except InputError as error:
                raise InputError(f"input {name}: {error}") from error
            values[name], alpha = picture.pixels, picture.alpha
        else:
            values[name] = np.asarray(arrays[name])
    return Inputs(checked(plan, values, given_by="argument"), dict.fromkeys(values, "array"), alpha)


def checked(plan: Plan, values: Mapping[str, np.ndarray], given_by: str) -> dict[str, np.ndarray]:
    """Check presence, dtype, shape, values and common size of a plan's inputs."""
    missing = [f"{name} ({plan.graph.inputs[name]})" for name in plan.inputs if name not in values]
    if missing:
        how = "-i NAME=FILE or --scene" if given_by == "file" else "as a keyword argument"
        raise InputError(f"{plan.graph.source} needs {', '.join(missing)}; give it with {how}.")
    checked_values = {}
    sizes: dict[str, tuple[int, str]] = {}
    for name in plan.inputs:
        kind = plan.graph.inputs[name]
        array = values[name]
        if array.dtype == np.float16:
            array = array.astype(np.float32)
        if problem := kind.misfit(array) or kind.bad_values(array):
            raise InputError(f"input {name}: {problem}.{_advice(kind, array)}")
        for symbol, size in _sizes(kind, array).items():
            other, owner = sizes.setdefault(symbol, (size, name))
            if other != size:
                raise InputError(
                    f"input {name} has shape {array.shape} and {owner} has {values[owner].shape}; "
                    f"all inputs of a run must have the same height and width. Resample one of them."
                )
        checked_values[name] = array
    return checked_values


def _sizes(kind: Kind, array: np.ndarray) -> dict[str, int]:
    shape = next((shape for shape in kind.shapes if len(shape) == array.ndim), ())
    return {symbol: size for symbol, size in zip(shape, array.shape, strict=True) if isinstance(symbol, str)}


def _advice(kind: Kind, array: np.ndarray) -> str:
    if kind.name in _DISTANCES and np.issubdtype(array.dtype, np.integer):
        return " Convert codes to metres first; on the command line --depth names the encoding."
    if kind.name in _DISTANCES and array.ndim == 3:
        return " A picture of depth in colours holds no metres; give the depth itself."
    return ""


def _read(plan: Plan, name: str, request: Request) -> tuple[np.ndarray, np.ndarray | None, tuple[str, ...]]:
    """One input from its file: the values, an opacity if it is a picture with one, and notes."""
    kind = plan.graph.inputs[name]
    text = request.files[name]
    if kind.is_scalar:
        try:
            return np.array(float(text)), None, ()
        except ValueError as error:
            raise InputError(f"-i {name}={text}: {kind} is a single number.") from error
    path = Path(text)
    if kind.name == "Image":
        from fogpipe.io.images import read_image

        picture = read_image(path, color=plan.graph.color)
        return picture.pixels, picture.alpha, (f"{name}: {picture.description}",)
    if kind.name in _DISTANCES:
        return _read_distance(kind, name, path, request)
    if kind.name == "Camera":
        from fogpipe.io.camera import read_camera

        return read_camera(path).matrix, None, ()
    from fogpipe.io.maps import read_map

    array = read_map(path)
    return (array > 0.5 if kind.dtype == "bool" else array), None, ()


def _read_distance(
    kind: Kind, name: str, path: Path, request: Request
) -> tuple[np.ndarray, np.ndarray | None, tuple[str, ...]]:
    from fogpipe.io.camera import read_camera
    from fogpipe.io.depth import read_depth, to_range

    camera = read_camera(Path(request.camera)) if request.camera else None
    depth = read_depth(path, encoding=request.depth, camera=camera)
    if kind.name == "Range":
        if depth.geometry == "relative":
            raise InputError(f"input {name}: {path} holds relative depth, which has no metres; {kind} is needed.")
        array, notes = to_range(depth, camera)
        return array, None, (*depth.notes, *notes)
    if (kind.name == "RelativeDepth") != (depth.geometry == "relative") or depth.geometry == "radial":
        raise InputError(f"input {name}: {path} holds {depth.geometry} distance, but {kind} is needed.")
    return depth.values, None, depth.notes


def _absolute(text: str) -> str:
    path = Path(text)
    return str(path.resolve()) if path.exists() else text
