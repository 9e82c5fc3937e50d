"""``fogpipe new-plugin`` writes a package that installs, works and passes its own test, or nothing."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from tests.packages import install, run_fogpipe, run_python


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package that ``fogpipe new-plugin ice-fog`` writes."""
    here = tmp_path_factory.mktemp("new")
    ended = run_fogpipe("new-plugin", "ice-fog", cwd=here)
    assert ended.returncode == 0, ended.stderr
    return here / "fogpipe-ice-fog"


@pytest.fixture(scope="module")
def installed(package: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with that package, as pip installs it."""
    target = tmp_path_factory.mktemp("site")
    install(package, "--target", target)
    return target


def test_it_says_what_was_written_and_what_comes_next(fogpipe_cli, tmp_path: Path):
    ended = fogpipe_cli("new-plugin", "frost", "-o", tmp_path / "two words")
    assert ended.code == 0
    assert f"wrote {tmp_path / 'two words'}; next: pip install -e '{tmp_path / 'two words'}'" in ended.err
    assert [path.name for path in tmp_path.iterdir()] == ["two words"]


def test_the_stage_is_found_once_the_package_is_installed(installed: Path):
    shown = run_fogpipe("show", "ice_fog.fade", path=installed)
    assert shown.returncode == 0, shown.stderr
    assert "fogpipe-ice-fog 0.1.0" in shown.stdout


def test_the_test_of_the_package_passes(package: Path, installed: Path):
    ended = run_python("-m", "pytest", "-q", "-p", "no:cacheprovider", path=installed, cwd=package)
    assert ended.returncode == 0, ended.stdout
    assert "2 passed" in ended.stdout


def test_it_installs_so_that_edits_count_at_once(package: Path, tmp_path: Path):
    install(package, "--prefix", tmp_path, "-e")
    site = next(tmp_path.rglob("*.dist-info")).parent
    script = (
        "import site, sys; site.addsitedir(sys.argv[1])\n"
        "from fogpipe.registry import Registry\n"
        "print(sys.modules[Registry().find('ice_fog.fade').function.__module__].__file__)"
    )
    ended = run_python("-c", script, site)
    assert ended.stdout.strip() == str(package / "fogpipe_ice_fog" / "ice_fog.py"), ended.stderr


def test_the_prefix_of_the_package_may_be_part_of_the_name(fogpipe_cli, tmp_path: Path):
    assert fogpipe_cli("new-plugin", "fogpipe-frost", "-o", tmp_path / "new").code == 0
    assert (tmp_path / "new" / "fogpipe_frost" / "frost.py").is_file()


@pytest.mark.parametrize(
    "name", ["", "Frost", "ice_fog", "-frost", "frost-", "ice--fog", "2d", "../frost", "naïve", "class"]
)
def test_a_bad_name_ends_with_2_and_writes_nothing(fogpipe_cli, tmp_path: Path, monkeypatch, name: str):
    monkeypatch.chdir(tmp_path)
    ended = fogpipe_cli("new-plugin", "--", name)
    assert ended.code == 2
    assert ended.err.startswith(f"new-plugin {name}: ")
    assert len(ended.err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_an_existing_folder_ends_with_2_and_is_left_alone(fogpipe_cli, tmp_path: Path):
    ended = fogpipe_cli("new-plugin", "frost", "-o", tmp_path)
    assert ended.code == 2
    assert ended.err == f"{tmp_path} exists; name another folder with -o, nothing was written.\n"
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_to_ends_with_1(fogpipe_cli, tmp_path: Path):
    (tmp_path / "file").touch()
    ended = fogpipe_cli("new-plugin", "frost", "-o", tmp_path / "file" / "frost")
    assert ended.code == 1
    assert ended.err.startswith(f"{tmp_path / 'file' / 'frost'} cannot be written: ")
    assert len(ended.err.splitlines()) == 1


def test_a_full_disk_leaves_nothing_behind(fogpipe_cli, tmp_path: Path, monkeypatch):
    write_text = Path.write_text

    def full_after_the_first(path: Path, text: str, **options: str) -> int:
        if path.name != "pyproject.toml":
            raise OSError(errno.ENOSPC, "No space left on device")
        return write_text(path, text, **options)

    monkeypatch.setattr(Path, "write_text", full_after_the_first)
    ended = fogpipe_cli("new-plugin", "frost", "-o", tmp_path / "frost")
    assert ended.code == 1
    assert "No space left on device" in ended.err
    assert not list(tmp_path.iterdir())
