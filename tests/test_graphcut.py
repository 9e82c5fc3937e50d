"""The pack with the paper's own solver: its tests pass, where PyMaxflow is installed."""

from __future__ import annotations

from pathlib import Path

import pytest

from .packages import install, run_fogpipe, run_python

PACK = Path(__file__).resolve().parents[1] / "plugins" / "fogpipe-graphcut"


def test_its_tests_pass_and_its_stage_is_found(tmp_path: Path):
    pytest.importorskip("maxflow", reason="PyMaxflow, which is under the GPL, is not installed; the pack asks for it")
    install(PACK, "--target", tmp_path)
    shown = run_fogpipe("show", "graphcut.expansion", path=tmp_path)
    assert shown.returncode == 0, shown.stderr
    ended = run_python("-m", "pytest", "-q", "-p", "no:cacheprovider", PACK, path=tmp_path, cwd=PACK)
    assert ended.returncode == 0, ended.stdout
    assert "passed" in ended.stdout
