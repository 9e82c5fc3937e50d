"""Installs packages and runs Python, for tests that need what a user has: a package on the path, a new process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def install(package: Path, *place: str | Path) -> None:
    """``pip install`` with neither dependencies nor network; ``place`` is ``--target DIR`` and the like."""
    options = ("--quiet", "--disable-pip-version-check", "--no-index", "--no-deps", "--no-build-isolation")
    ended = run_python("-m", "pip", "install", *options, *place, package)
    assert ended.returncode == 0, ended.stderr


def run_python(
    *arguments: str | Path, path: Path | None = None, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run Python in a process of its own, with one more folder to import from."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTEST_ADDOPTS"}
    environment |= {"PYTHONPATH": str(path)} if path else {}
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, env=environment, cwd=cwd, capture_output=True, text=True, timeout=300)


def run_fogpipe(
    *arguments: str | Path, path: Path | None = None, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own."""
    return run_python("-c", "from fogpipe.cli.main import main; main()", *arguments, path=path, cwd=cwd)
