"""The pipelines that come with fogpipe."""

from __future__ import annotations

from pathlib import Path

from fogpipe.errors import InputError, suggestion

_PACKAGE = Path(__file__).resolve().parents[1]
# A wheel carries the folder inside the package; a checkout has it at the top level.
_FOLDERS = (_PACKAGE / "pipelines", _PACKAGE.parent / "pipelines")


def shipped_pipelines() -> dict[str, Path]:
    """Names and files of the pipelines that come with fogpipe."""
    folder = next((folder for folder in _FOLDERS if folder.is_dir()), None)
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))} if folder else {}


def find_pipeline(name: str | Path) -> Path:
    """The file of a shipped pipeline, or the path itself.

    Raises
    ------
    InputError
        If there is neither a shipped pipeline of that name nor such a file.
    """
    shipped = shipped_pipelines()
    if str(name) in shipped:
        return shipped[str(name)]
    path = Path(name)
    if path.is_file():
        return path
    raise InputError(f'there is no pipeline "{name}", neither shipped nor as a file.{suggestion(str(name), shipped)}')


def read_pipeline(name: str | Path) -> tuple[str, str]:
    """The YAML text of a pipeline, and what messages call it."""
    path = find_pipeline(name)
    try:
        return path.read_text(encoding="utf-8"), str(path if Path(name) == path else f"{name}.yaml")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text, as a pipeline is: {error.reason}.") from error
