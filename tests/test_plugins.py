"""Stages from elsewhere: installed packages, local folders, and plugins that are broken."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import fogpipe
from fogpipe.cli.options import load_pipeline
from fogpipe.errors import PipelineError, RequestError

from .packages import install, run_fogpipe, run_python

PACK = Path(__file__).resolve().parents[1] / "plugins" / "fogpipe-sensor"

NOISE = """\
fogpipe: 1
seed: 3
inputs: {image: Image}
stages:
  noisy: {use: sensor.noise, in: {image: image}, with: {full_well: 500, read_noise: 0}}
outputs: {noisy: noisy}
"""
DIM = """\
fogpipe: 1
inputs: {image: Image}
stages:
  dimmed: {use: lamp.dim, in: {image: image}}
outputs: {dimmed: dimmed}
"""
LAMP = '''\
from fogpipe.ports import Image
from fogpipe.stage import stage


@stage("lamp.dim")
def dim(image: Image) -> Image:
    """Halve the light."""
    return image / 2
'''


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the example pack, as pip installs it."""
    target = tmp_path_factory.mktemp("site")
    install(PACK, "--target", target)
    return target


def test_an_installed_pack_is_found_by_its_entry_point(installed: Path):
    listed = run_fogpipe("stages", "--json", path=installed)
    assert listed.returncode == 0, listed.stderr
    origins = {row["name"]: row["origin"] for row in json.loads(listed.stdout)["stages"]}
    assert origins["sensor.noise"] == "fogpipe-sensor 0.1.0"
    assert "medium.transmission" in origins


def test_its_stage_runs_in_a_pipeline(installed: Path, tmp_path: Path):
    (tmp_path / "noise.yaml").write_text(NOISE)
    script = (
        "import sys, numpy, fogpipe\n"
        "image = numpy.full((40, 50, 3), 0.25, numpy.float32)\n"
        "numpy.save(sys.argv[2], fogpipe.load(sys.argv[1]).run(image=image)['noisy'])\n"
    )
    ended = run_python("-c", script, tmp_path / "noise.yaml", tmp_path / "noisy.npy", path=installed)
    assert ended.returncode == 0, ended.stderr
    noisy = np.load(tmp_path / "noisy.npy")
    assert noisy.shape == (40, 50, 3)
    # The variance of n values that follow the model x/N has the relative standard error √(2/n); five of them.
    assert noisy.var() == pytest.approx(0.25 / 500, rel=5 * np.sqrt(2 / noisy.size))


def test_the_pipeline_in_the_pack_is_valid(installed: Path):
    checked = run_fogpipe("check", PACK / "pipelines" / "noisy-haze.yaml", path=installed)
    assert checked.returncode == 0, checked.stderr


@pytest.fixture
def broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder on the path with an installed package whose module cannot be imported."""
    info = tmp_path / "site" / "fogpipe_lamp-2.1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: fogpipe-lamp\nVersion: 2.1\n")
    (info / "entry_points.txt").write_text("[fogpipe.stages]\nlamp = fogpipe_lamp\n")
    (info.parent / "fogpipe_lamp.py").write_text("import a_library_that_nobody_has\n")
    (tmp_path / "dim.yaml").write_text(DIM)
    monkeypatch.syspath_prepend(str(info.parent))
    return tmp_path


def test_a_broken_package_breaks_no_pipeline_that_does_not_need_it(broken: Path):
    pipeline = fogpipe.load("hansard2019")
    assert "lamp" in pipeline.registry.sources
    assert not pipeline.registry.failures


def test_a_broken_package_is_named_with_the_reason_where_it_is_needed(broken: Path):
    reason = r"fogpipe-lamp 2\.1: ModuleNotFoundError: No module named 'a_library_that_nobody_has'"
    with pytest.raises(PipelineError, match=rf"dim\.yaml:4:12  stages\.dimmed\.use\n.*lamp\.dim.*{reason}"):
        fogpipe.load(broken / "dim.yaml")


def test_a_broken_package_is_listed_and_the_others_too(broken: Path):
    listed = run_fogpipe("stages", path=broken / "site")
    assert listed.returncode == 0
    assert "medium.transmission" in listed.stdout
    assert "lamp.* cannot be used: fogpipe-lamp 2.1" in listed.stderr


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A folder with a pipeline and, in ``stages``, the local stage that it uses."""
    (tmp_path / "stages").mkdir()
    (tmp_path / "stages" / "lamp.py").write_text(LAMP)
    (tmp_path / "dim.yaml").write_text(DIM)
    return tmp_path


def test_a_local_folder_is_named_on_the_command_line(project: Path):
    assert run_fogpipe("check", "dim.yaml", cwd=project).returncode == 2
    ended = run_fogpipe("check", "dim.yaml", "--plugins", "stages", cwd=project)
    assert ended.returncode == 0, ended.stderr


def test_a_local_folder_is_named_in_the_project_file(project: Path, monkeypatch: pytest.MonkeyPatch):
    (project / "pyproject.toml").write_text('[tool.fogpipe]\nplugins = ["stages"]\n')
    (project / "deeper").mkdir()
    monkeypatch.chdir(project / "deeper")
    assert load_pipeline("../dim.yaml").graph.nodes["dimmed"].origin == str(project / "stages" / "lamp.py")


def test_a_local_folder_is_named_in_python(project: Path):
    image = np.ones((2, 2, 3), np.float32)
    dimmed = fogpipe.load(project / "dim.yaml", plugins=[project / "stages"]).run(image=image)["dimmed"]
    np.testing.assert_array_equal(dimmed, image / 2)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ('plugins = "stages"', "must be a list of folders"),
        ('plugin = ["stages"]', "has no setting plugin; there is: plugins"),
        ('plugins = ["nowhere"]', "does not exist"),
        ("plugins = [", "is not readable TOML"),
    ],
)
def test_wrong_settings_are_one_clear_error(
    project: Path, settings: str, message: str, monkeypatch: pytest.MonkeyPatch
):
    (project / "pyproject.toml").write_text(f"[tool.fogpipe]\n{settings}\n")
    monkeypatch.chdir(project)
    with pytest.raises(RequestError, match=message):
        load_pipeline("dim.yaml")
