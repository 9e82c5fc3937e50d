"""Readers are found as stages are: by entry points, and in local folders."""

from __future__ import annotations

from pathlib import Path

import pytest

from fogpipe.datasets.catalogue import find_reader, open_dataset, options_of, readers
from fogpipe.errors import InputError, RequestError

READER = '''\
from collections.abc import Iterator

from fogpipe.datasets.folder import Folder
from fogpipe.datasets.item import Item, reader


@reader("twins")
def twins(folder: Folder, *, twice: bool = False, count: int) -> Iterator[Item]:
    """Every picture, as often as you like."""
    for path, found in folder.matches(r"(?P<name>.+)\\.png"):
        for number in range(count * (2 if twice else 1)):
            yield Item(f"{found['name']}/{number}", {"image": folder.path(path)})
'''


@pytest.fixture
def plugins(tmp_path: Path) -> Path:
    (tmp_path / "stages").mkdir()
    (tmp_path / "stages" / "twins.py").write_text(READER)
    (tmp_path / "stages" / "broken.py").write_text("import a_library_that_nobody_has")
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "a.png").write_bytes(b"")
    return tmp_path / "stages"


def test_a_reader_in_a_local_folder_is_found_with_the_types_of_its_options(plugins: Path):
    data = open_dataset(f"twins:{plugins.parent}/data", {"count": "2", "twice": "yes"}, [plugins])
    assert [*data.items] == [f"a/{number}" for number in range(4)]


def test_every_own_reader_tells_its_layout_and_its_formula():
    names = {name for name, source in readers().items() if source.origin.startswith("fogpipe ")}
    assert {"folder", "csv", "kitti", "cityscapes", "virtual-kitti2", "middlebury2014", "nyu", "tartanair"} <= names
    for name in names:
        text = find_reader(name).__doc__ or ""
        assert "::\n" in text, name  # the layout
        assert "Z = " in text or name in ("folder", "csv"), name
        for option in options_of(find_reader(name)):
            assert f"    {option} : " in text, f"{name}: {option}"


@pytest.mark.parametrize(
    ("text", "options", "error", "message"),
    [
        ("twins", {}, RequestError, "write it as NAME:FOLDER"),
        ("twin:data", {}, InputError, 'no reader "twin" of data sets. Did you mean "twins"'),
        ("twins:data", {}, RequestError, "needs --option count=…"),
        ("twins:data", {"count": "many"}, RequestError, "--option count=many: Input should be a valid integer"),
        ("broken:data", {}, InputError, r"broken\.py: ModuleNotFoundError: No module named 'a_library"),
    ],
)
def test_what_cannot_be_opened_is_one_clear_error(
    plugins: Path, text: str, options: dict[str, str], error: type[Exception], message: str
):
    with pytest.raises(error, match=message):
        open_dataset(text, options, [plugins])


def test_a_module_without_a_reader_of_its_name_is_named(plugins: Path):
    (plugins / "mist.py").write_text("x = 1")
    with pytest.raises(InputError, match=r'mist\.py holds no function with @reader\("mist"\)'):
        find_reader("mist", [plugins])
