"""The packs in ``plugins``: their own tests pass, wherever what they depend on is installed."""

from __future__ import annotations

from pathlib import Path

import pytest

from .packages import install, run_python

PLUGINS = Path(__file__).resolve().parents[1] / "plugins"
NEEDS = {
    "fogpipe-sensor": (),
    "fogpipe-graphcut": ("maxflow",),
    "fogpipe-onnx": ("onnxruntime", "onnx"),
    "fogpipe-torch": (),  # its tests of arrays need neither PyTorch nor Albumentations; the others skip themselves
}


def test_every_pack_is_listed():
    assert {path.parent.name for path in PLUGINS.glob("*/pyproject.toml")} == NEEDS.keys()


@pytest.mark.parametrize("pack", NEEDS)
def test_the_tests_of_a_pack_pass(pack: str, tmp_path: Path):
    for module in NEEDS[pack]:
        pytest.importorskip(module, reason=f"{module}, which {pack} depends on and fogpipe does not, is not installed")
    install(PLUGINS / pack, "--target", tmp_path)
    ended = run_python(
        "-m", "pytest", "-q", "-p", "no:cacheprovider", PLUGINS / pack, path=tmp_path, cwd=PLUGINS / pack
    )
    assert ended.returncode == 0, ended.stdout
    assert "passed" in ended.stdout
