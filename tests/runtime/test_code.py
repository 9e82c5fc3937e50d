"""The code of a stage, as far as a cache and a record are concerned."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from fogpipe.runtime.code import _imports, code_digest


@pytest.fixture
def package(tmp_path: Path, monkeypatch):
    """A package whose stage imports a kernel when it is called, and the kernel a helper."""
    home = tmp_path / "some_package"
    home.mkdir()
    (home / "__init__.py").write_text("")
    (home / "work.py").write_text("def work():\n    from some_package.kernel import run\n    return run()\n")
    (home / "kernel.py").write_text("from . import helper\ndef run():\n    return helper.VALUE\n")
    (home / "helper.py").write_text("VALUE = 1\n")
    (home / "other.py").write_text("VALUE = 1\n")
    monkeypatch.syspath_prepend(tmp_path)

    def fresh() -> str:
        for name in [name for name in sys.modules if name.startswith("some_package")]:
            monkeypatch.delitem(sys.modules, name)
        from some_package.work import work  # type: ignore[import-not-found]

        return code_digest(work)

    return home, fresh


@pytest.mark.parametrize("name", ["work.py", "kernel.py", "helper.py"])
def test_a_change_in_what_a_stage_uses_changes_its_digest_though_it_is_imported_late(package, name: str):
    home, fresh = package
    before = fresh()
    assert fresh() == before
    with (home / name).open("a") as file:
        file.write("# changed\n")
    assert fresh() != before


def test_what_has_been_imported_meanwhile_does_not_matter(package):
    _, fresh = package
    before = fresh()
    sys.modules["some_package.work"].work()
    assert "some_package.kernel" in sys.modules
    code_digest.cache_clear()
    assert code_digest(sys.modules["some_package.work"].work) == before


def test_a_module_that_was_imported_before_its_file_was_edited_is_another_code(package):
    home, fresh = package
    (home / "kernel.py").write_text("from . import helper\ndef run():\n    return helper.VALUE + 1\n")
    edited = fresh()
    (home / "kernel.py").write_text("from . import helper\ndef run():\n    return helper.VALUE\n")
    fresh()
    sys.modules["some_package.work"].work()
    (home / "kernel.py").write_text("from . import helper\ndef run():\n    return helper.VALUE + 1\n")
    code_digest.cache_clear()
    assert code_digest(sys.modules["some_package.work"].work) != edited


def test_a_module_that_the_stage_does_not_use_does_not_matter(package):
    home, fresh = package
    before = fresh()
    (home / "other.py").write_text("VALUE = 2\n")
    assert fresh() == before


def test_the_kernels_of_fogpipe_are_part_of_its_stages():
    source = Path(sys.modules[code_digest.__module__].__file__ or "").parents[1] / "stages" / "sky.py"
    assert "fogpipe.kernels.matting" in set(_imports(source.read_bytes(), "fogpipe.stages.sky"))


def test_a_function_without_source_has_a_digest_too():
    assert code_digest(len) == code_digest(print)
