"""``fogpipe new-plugin``."""

from __future__ import annotations

import re
import shutil
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from fogpipe.errors import OutputError, RequestError

_PROJECT = """\
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "fogpipe-{name}"
version = "0.1.0"
description = "Stages of the subject {subject} for fogpipe."
requires-python = ">=3.11"
dependencies = ["fogpipe", "numpy"]

[project.optional-dependencies]
test = ["pytest"]

# The subject (the part of a stage name before the dot) and the module that holds its stages.
[project.entry-points."fogpipe.stages"]
{subject} = "fogpipe_{subject}"
"""

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
    image : (H, W, 3) colours in the working space.
    amount : 0 leaves the image as it is, 1 leaves nothing but the mean.

    Returns
    -------
    (H, W, 3) array of the dtype of ``image``.
    """
    mean = image.mean(axis=(0, 1), keepdims=True)
    return (1 - amount) * image + amount * np.broadcast_to(mean, image.shape)
'''

_TEST = """\
import numpy as np
from fogpipe.testing import check_stage

from fogpipe_{subject} import fade


def test_fade_keeps_the_promises_of_a_stage():
    check_stage(fade)


def test_fade_by_one_leaves_the_mean_colour():
    image = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    # The mean of 8 float32 values is exact to a few units in the last place.
    np.testing.assert_allclose(fade(image, amount=1.0), np.broadcast_to(image.mean((0, 1)), image.shape), rtol=1e-6)
"""

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
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name):
        raise RequestError(f'new-plugin {name}: use small letters, digits and single hyphens, such as "frost".')
    folder = out or Path(f"fogpipe-{name}")
    if folder.exists():
        raise RequestError(f"{folder} exists; name another folder with -o, nothing was written.")
    words = {"name": name, "subject": name.replace("-", "_")}
    files = {
        "pyproject.toml": _PROJECT,
        "README.md": _README,
        f"fogpipe_{words['subject']}.py": _MODULE,
        f"tests/test_{words['subject']}.py": _TEST,
    }
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        # Written beside its place and moved there, so that half a package never appears.
        draft = Path(tempfile.mkdtemp(dir=folder.parent, prefix=".new-"))
        for path, text in files.items():
            (draft / path).parent.mkdir(exist_ok=True)
            (draft / path).write_text(text.format(**words), encoding="utf-8")
        draft.chmod(0o755)
        shutil.move(draft, folder)
    except OSError as error:
        raise OutputError(f"cannot write {folder}: {error.strerror}.") from error
    typer.echo(f"wrote {folder}; next: pip install -e '{folder}[test]' && pytest {folder}", err=True)
