"""``fogpipe new-plugin``."""

from __future__ import annotations

import keyword
import re
import shlex
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from fogpipe.errors import OutputError, RequestError

_PROJECT = """\
[build-system]
requires = ["hatchling>=1.25"]
build-backend = "hatchling.build"

[project]
name = "fogpipe-{name}"
version = "0.1.0"
description = "Stages of the subject {subject} for fogpipe."
readme = "README.md"
requires-python = ">=3.11"
dependencies = ["fogpipe>=0.1", "numpy>=2.0", "annotated-types>=0.7"]

[project.optional-dependencies]
test = ["pytest>=8.3"]

# The subject (the part of a stage name before the dot) and the module that holds its stages.
[project.entry-points."fogpipe.stages"]
{subject} = "fogpipe_{subject}.{subject}"

[tool.pytest.ini_options]
testpaths = ["tests"]

[tool.ruff]
line-length = 120
"""

_PACKAGE = '''\
"""Stages for fogpipe; they are in :mod:`fogpipe_{subject}.{subject}`."""
'''

_MODULE = '''\
"""Stages of the subject {subject}."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Ge, Le
from fogpipe.ports import Image
from fogpipe.stage import stage


@stage("{subject}.fade")
def fade(image: Image, *, amount: Annotated[float, Ge(0), Le(1)] = 0.5) -> Image:
    """Blend an image with its own mean colour.

    Parameters
    ----------
    image : (H, W, 3) float, colours in the working space.
    amount : 0 leaves the image as it is, 1 leaves nothing but the mean.

    Returns
    -------
    (H, W, 3) array of the dtype of ``image``.
    """
    mean = image.mean(axis=(0, 1), keepdims=True)
    return (1 - amount) * image + amount * np.broadcast_to(mean, image.shape)
'''

_TEST = '''\
"""The stages of the subject {subject}."""

import numpy as np
from fogpipe.testing import check_stage

from fogpipe_{subject}.{subject} import fade


def test_fade_keeps_the_promises_of_a_stage():
    check_stage(fade)


def test_fade_by_one_leaves_the_mean_colour():
    image = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    # Sums of 8 whole numbers and their division by 8 are exact in float32.
    np.testing.assert_array_equal(fade(image, amount=1.0), np.broadcast_to(image.mean((0, 1)), image.shape))
'''

_README = """\
# fogpipe-{name}

Stages of the subject `{subject}` for fogpipe.

    pip install -e ".[test]" && pytest
    fogpipe show {subject}.fade
"""


def command(
    name: Annotated[str, typer.Argument(help="A short name, such as 'frost'.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="DIR", help="Folder for the package.")] = None,
) -> None:
    """Write a small installable package with one stage and a passing test."""
    from fogpipe.registry import Registry

    name = name.removeprefix("fogpipe-")
    subject = name.replace("-", "_")
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name):
        raise RequestError(f'new-plugin {name}: use small letters, digits and single hyphens, such as "frost".')
    if keyword.iskeyword(subject):
        raise RequestError(f"new-plugin {name}: is a word of Python and cannot name a module; use another one.")
    if sources := Registry().sources.get(subject):
        raise RequestError(
            f'new-plugin {name}: {sources[0].origin} holds stages "{subject}.*" already; use another name.'
        )
    folder = out or Path(f"fogpipe-{name}")
    if folder.exists():
        raise RequestError(f"{folder} exists; name another folder with -o, nothing was written.")
    _write(folder, name, subject)
    quoted = shlex.quote(str(folder))
    typer.echo(f"wrote {folder}; next: pip install -e {quoted}'[test]' && pytest {quoted}", err=True)


def _write(folder: Path, name: str, subject: str) -> None:
    """Write the package beside its place and move it there, so that half of one never appears."""
    files = {
        "pyproject.toml": _PROJECT,
        "README.md": _README,
        f"fogpipe_{subject}/__init__.py": _PACKAGE,
        f"fogpipe_{subject}/{subject}.py": _MODULE,
        f"tests/test_{subject}.py": _TEST,
    }
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".new-") as temporary:
            draft = Path(temporary) / "package"
            for path, text in files.items():
                (draft / path).parent.mkdir(parents=True, exist_ok=True)
                (draft / path).write_text(text.format(name=name, subject=subject), encoding="utf-8")
            draft.rename(folder)
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror}. Name another folder with -o.") from error
