"""Compiled kernels where nothing beside them and nothing at home can be written."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import fogpipe

PROGRAM = """
import os
from fogpipe.kernels import rays
import numpy as np
print(os.environ.get("NUMBA_CACHE_DIR", ""))
print(rays.__file__)
print(rays.planar_to_radial(np.full((1, 1), 2, np.float32), np.eye(3))[0, 0])
"""


@pytest.fixture
def installation(tmp_path: Path) -> Path:
    """A copy of fogpipe with a file where the folder of machine code would be: no user, not even root, can make it."""
    shutil.copytree(Path(fogpipe.__file__).parent, tmp_path / "fogpipe", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "fogpipe" / "kernels" / "__pycache__").touch()
    return tmp_path


def run(installation: Path, **environment: str) -> str:
    kept = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment = kept | {"PYTHONPATH": str(installation), "PYTHONDONTWRITEBYTECODE": "1"} | environment
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(command, cwd=installation, env=environment, capture_output=True, text=True, check=True)
    folder, module, distance = done.stdout.splitlines()
    assert Path(module).is_relative_to(installation)
    assert float(distance) == 2
    return folder


def test_without_a_home_a_temporary_folder_does_and_goes_with_the_process(installation, tmp_path):
    (tmp_path / "home").touch()
    home, temporary = str(tmp_path / "home"), tmp_path / "temporary"
    temporary.mkdir()
    folder = run(installation, HOME=home, XDG_CACHE_HOME=home, TMPDIR=str(temporary))
    assert Path(folder).parent == temporary
    assert list(temporary.iterdir()) == []


def test_a_home_that_can_be_written_is_used(installation, tmp_path):
    home = str(tmp_path / "home")
    assert run(installation, HOME=home, XDG_CACHE_HOME=home) == ""
    assert list((tmp_path / "home").rglob("*.nbi"))


def test_the_users_own_choice_stays(installation, tmp_path):
    assert run(installation, NUMBA_CACHE_DIR=str(tmp_path / "chosen")) == str(tmp_path / "chosen")
    assert list((tmp_path / "chosen").rglob("*.nbi"))
