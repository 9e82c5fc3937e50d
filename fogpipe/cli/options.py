"""Options that several verbs share, and what they mean."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fogpipe.errors import RequestError

if TYPE_CHECKING:
    from fogpipe.runtime.inputs import Request
    from fogpipe.runtime.pipeline import Pipeline

PipelineName = Annotated[
    str,
    typer.Argument(
        metavar="PIPELINE",
        help="A shipped pipeline (hansard2019, photo-fog, yan2013, …; a wrong name lists all) or a YAML file.",
    ),
]
Scene = Annotated[str | None, typer.Option(help="sample:motorcycle, sample:outdoor, … or a scene file.")]
InputFiles = Annotated[list[str] | None, typer.Option("-i", "--input", metavar="NAME=FILE", help="File of one input.")]
DepthEncoding = Annotated[str | None, typer.Option("--depth", metavar="ENCODING", help="How depth files are encoded.")]
CameraFile = Annotated[str | None, typer.Option(metavar="FILE", help="Camera intrinsics (JSON or calib.txt).")]
Settings = Annotated[list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Set stage.parameter.")]
Outputs = Annotated[list[str] | None, typer.Option("--to", metavar="OUTPUT", help="Compute only this; repeatable.")]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of everything random.")]
Tolerance = Annotated[float | None, typer.Option(help="RMS error allowed in each approximated stage.")]
Plugins = Annotated[list[Path] | None, typer.Option("--plugins", metavar="DIR", help="Folder of local stages.")]
CacheFolder = Annotated[Path | None, typer.Option("--cache", metavar="DIR", help="Keep and reuse results of stages.")]
CacheLimit = Annotated[
    float | None, typer.Option("--cache-limit", metavar="GB", min=0, help="Most that the cache may hold; 4 by default.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Machine-readable output on standard output.")]


@dataclass(frozen=True)
class Project:
    """Settings of the project one stands in: ``[tool.fogpipe]`` of the nearest ``pyproject.toml``."""

    plugins: tuple[Path, ...] = ()

    @classmethod
    def here(cls) -> Project:
        """Read the settings; RequestError where they are not of the right form."""
        for folder in (Path.cwd(), *Path.cwd().parents):
            path = folder / "pyproject.toml"
            if path.is_file():
                return cls._read(path)
        return cls()

    @classmethod
    def _read(cls, path: Path) -> Project:
        try:
            settings = tomllib.loads(path.read_text(encoding="utf-8")).get("tool", {}).get("fogpipe", {})
        except OSError as error:
            raise RequestError(f"{path} cannot be read: {error.strerror}.") from error
        except ValueError as error:
            raise RequestError(f"{path} is not readable TOML: {error}.") from error
        plugins = settings.get("plugins", [])
        if unknown := settings.keys() - {"plugins"}:
            raise RequestError(
                f"{path}: [tool.fogpipe] has no setting {', '.join(sorted(unknown))}; there is: plugins."
            )
        if not isinstance(plugins, list) or not all(isinstance(item, str) for item in plugins):
            raise RequestError(f"{path}: [tool.fogpipe] plugins must be a list of folders.")
        return cls(tuple(path.parent / item for item in plugins))


def plugin_folders(given: Iterable[Path] | None) -> tuple[Path, ...]:
    """Folders of local stages: the project's and those on the command line."""
    return (*Project.here().plugins, *(given or ()))


def load_pipeline(
    name: str,
    settings: list[str] | None = None,
    plugins: list[Path] | None = None,
    seed: int | None = None,
    tolerance: float | None = None,
) -> Pipeline:
    """Load and check a pipeline as the command line asks for it."""
    from fogpipe.pipeline.spec import parse_override
    from fogpipe.runtime.pipeline import load

    overrides: dict[str, Any] = {}
    for text in settings or ():
        try:
            key, value = parse_override(text)
        except ValueError as error:
            raise RequestError(str(error)) from error
        overrides[key] = value
    return load(name, set=overrides, seed=seed, tolerance=tolerance, plugins=plugin_folders(plugins))


def make_request(scene: str | None, inputs: list[str] | None, depth: str | None, camera: str | None) -> Request:
    """Where the inputs come from, as the command line says it."""
    from fogpipe.runtime.inputs import Request

    files = {}
    for text in inputs or ():
        name, equals, path = text.partition("=")
        if not equals or not name or not path:
            raise RequestError(f"-i {text}: write it as NAME=FILE, for example -i image=photo.png.")
        files[name] = path
    return Request(scene, files, depth, camera)


def print_card(markdown: str) -> None:
    """Print Markdown to standard output, laid out where that is a terminal."""
    if not sys.stdout.isatty():
        typer.echo(markdown)
        return
    from rich.console import Console
    from rich.markdown import Markdown

    Console().print(Markdown(markdown))
