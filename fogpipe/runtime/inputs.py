"""The door: files, scenes and arrays become the checked inputs of a plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fogpipe.errors import InputError, did_you_mean, suggestion
from fogpipe.io.camera import camera_from, read_camera
from fogpipe.io.files import split_layer, split_part
from fogpipe.io.given import DISTANCES, Given, GivenInputs, camera_given, read_given
from fogpipe.pipeline.plan import Plan
from fogpipe.ports import Kind


@dataclass(frozen=True)
class Request:
    """Where the inputs of a run come from, as plain data that a record can repeat.

    Attributes
    ----------
    scene : ``sample:NAME`` or a scene file.
    files : a file (or, for a single number, its text) for each input by name; they replace the scene's.
    depth : name of the encoding of depth files.
    camera : file with the camera's intrinsics, or these as a mapping (see :mod:`fogpipe.io.camera`).
    """

    scene: str | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    depth: str | None = None
    camera: str | Mapping[str, float] | None = None

    def to_data(self, kinds: Mapping[str, Kind] | None = None) -> dict[str, Any]:
        """Plain data with absolute paths.

        Parameters
        ----------
        kinds : of the pipeline's inputs, by name; they tell which texts are numbers and stay as they are.
        """
        numbers = {name for name, kind in (kinds or {}).items() if kind.is_scalar}
        data = asdict(self)
        data["files"] = {name: text if name in numbers else _absolute(text) for name, text in self.files.items()}
        data["camera"] = _absolute(self.camera) if isinstance(self.camera, str) else self.camera
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
        If a file cannot be used, an input is missing or not known, sizes disagree, a picture that EXIF turned comes
        with a distance, one file is given as picture and distance, or an encoding or a camera is named that nothing
        is read with.
    """
    for name in request.files:
        if name not in plan.graph.inputs:
            meant = did_you_mean(name, plan.graph.inputs)
            takes = ", ".join(f"{known} ({kind})" for known, kind in plan.graph.inputs.items())
            raise InputError(f'-i {name}: {plan.graph.source} has no input "{name}".{meant} It takes {takes}.')
    _refuse_idle(plan, request)
    _refuse_one_for_both(plan, request)
    graph = plan.graph
    camera_files = {name: request.files[name] for name in request.files if graph.inputs[name].name == "Camera"}
    camera_file = request.camera or next(iter(camera_files.values()), None)
    own_camera = camera_from(camera_file) if camera_file else None
    scene = GivenInputs({}, own_camera)
    if request.scene:
        from fogpipe.io.scenes import open_scene

        missing = [name for name in plan.inputs if name not in request.files]
        scene = open_scene(request.scene).load(graph.color, missing, own_camera)
    given: dict[str, Given] = dict(scene.inputs)
    for name in plan.inputs:
        if name in request.files and name not in camera_files:
            kind, text = graph.inputs[name], request.files[name]
            given[name] = read_given(name, kind, text, color=graph.color, encoding=request.depth, camera=scene.camera)
    for name in plan.inputs:
        if graph.inputs[name].name == "Camera":
            camera = read_camera(camera_files[name]) if name in camera_files else scene.camera
            if camera:
                given[name] = camera_given(camera, given)
    everything = GivenInputs({name: given[name] for name in plan.inputs if name in given})
    values = checked(plan, everything.values, given_by="file", sources=everything.sources)
    return Inputs(values, everything.sources, everything.alpha, everything.notes)


def _refuse_idle(plan: Plan, request: Request) -> None:
    """An encoding or a camera that nothing would be read with is a mistake."""
    if any(plan.graph.inputs[name].name in DISTANCES for name in request.files):
        return
    takes_camera = any(plan.graph.inputs[name].name == "Camera" for name in plan.inputs)
    idle = [f"--depth {request.depth}"] if request.depth else []
    if request.camera and (request.scene or not takes_camera):
        idle.append(f"--camera {request.camera}")
    if idle:
        why = "the scene says both for its own" if request.scene else "there is none"
        raise InputError(
            f"{' and '.join(idle)} would change nothing: --depth and --camera say how a depth file given with -i is"
            f" encoded, and {why}. Leave them out, or give the depth file with -i."
        )


def _refuse_one_for_both(plan: Plan, request: Request) -> None:
    """One file is a picture or a depth map, and only OpenEXR holds both."""
    kinds = {name: plan.graph.inputs[name].name for name in request.files}
    pictures = {_absolute(file): name for name, file in request.files.items() if kinds[name] == "Image"}
    for name, file in request.files.items():
        picture = pictures.get(_absolute(file))
        if kinds[name] in DISTANCES and picture and not split_layer(file)[0].lower().endswith(".exr"):
            raise InputError(
                f"{file} is given as {picture} and as {name}, but it can only be one of them."
                f" Give a picture as {picture} and its depth map as {name}."
            )


def inputs_from_arrays(plan: Plan, arrays: Mapping[str, Any]) -> Inputs:
    """Take the inputs that a plan needs from arrays or numbers.

    Pictures of integers are sRGB display values and are brought to the pipeline's working space;
    pictures of floats are working values already, and refused where they are levels, since 1 is white. So are
    distances that are whole numbers only, since they are millimetres or other codes.
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

            array = np.asarray(arrays[name])
            if _are_levels(array):
                raise InputError(
                    f"input {name} holds whole numbers up to {array.max():g} as {array.dtype}, but 1 is white: pass"
                    " levels as uint8 or uint16, or floats of linear light."
                )
            try:
                picture = picture_from_array(array, color=plan.graph.color)
            except InputError as error:
                raise InputError(f"input {name}: {error}") from error
            values[name] = picture.pixels
            alpha = picture.alpha if alpha is None else alpha
        else:
            values[name] = np.asarray(arrays[name])
    return Inputs(checked(plan, values, given_by="argument"), dict.fromkeys(values, "array"), alpha)


def _are_levels(array: np.ndarray) -> bool:
    """Whether floats are 8- or 16-bit levels: whole numbers, one of them 16 or more."""
    return array.dtype.kind == "f" and array.size > 64 and 16 <= array.max() <= 65535 and not (array % 1).any()


def checked(
    plan: Plan, values: Mapping[str, np.ndarray], given_by: str, sources: Mapping[str, str] | None = None
) -> dict[str, np.ndarray]:
    """Check presence, dtype, shape, values and common size of a plan's inputs."""
    missing = [f"{name} ({plan.graph.inputs[name]})" for name in plan.inputs if name not in values]
    if missing:
        how = "with -i NAME=FILE, or a scene that has it" if given_by == "file" else "as a keyword argument"
        raise InputError(f"{plan.graph.source} needs {', '.join(missing)}; give it {how}.")
    checked_values = {}
    sizes: dict[str, tuple[int, str]] = {}
    where = {name: f"input {name} ({sources[name]})" if sources else f"input {name}" for name in plan.inputs}
    for name in plan.inputs:
        kind = plan.graph.inputs[name]
        array = values[name]
        if array.dtype == np.float16:
            array = array.astype(np.float32)
        if problem := kind.misfit(array) or kind.bad_values(array):
            raise InputError(f"input {name}: {problem}.{_advice(kind, array)}")
        if given_by == "argument" and kind.unit == "m" and kind.name in DISTANCES:
            from fogpipe.io.depth import CODES, are_codes

            if are_codes(values[name]):
                raise InputError(f"input {name}: {CODES}")
        for symbol, size in kind.sizes(array).items():
            other, owner = sizes.setdefault(symbol, (size, name))
            if other != size:
                raise InputError(
                    f"{where[name]} has shape {array.shape} and {where[owner]} has {values[owner].shape}; all inputs"
                    f" of a run must have the same height and width.{_size_advice(kind, plan.graph.inputs[owner])}"
                )
        checked_values[name] = array
    return checked_values


def _size_advice(*kinds: Kind) -> str:
    if any(kind.name in DISTANCES for kind in kinds):
        return " Resize the picture, not the depth: interpolated depth is false at edges."
    return " Export them at one size."


def _advice(kind: Kind, array: np.ndarray) -> str:
    if kind.name in DISTANCES and np.issubdtype(array.dtype, np.integer):
        return " Convert codes to metres first; on the command line --depth names the encoding."
    if kind.name in DISTANCES and array.ndim == 3:
        return " A picture of depth in colours holds no metres; give the depth itself."
    return ""


def _absolute(text: str) -> str:
    """The path from anywhere; ``picture.exr#left`` and ``labels.png#3`` keep their part."""
    file, part = split_layer(text)
    if not part:
        file, part = split_part(text)
    path = Path(file)
    if not path.exists():
        return text
    return f"{path.resolve()}#{part}" if part else str(path.resolve())
