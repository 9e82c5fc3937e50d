"""Stages are found by one mechanism, and a broken plugin breaks nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from fogpipe.errors import InputError, UnknownStageError
from fogpipe.registry import Registry
from tests.conftest import BROKEN_STAGES, TOY_STAGES


def test_own_stages_come_from_entry_points():
    registry = Registry()
    assert registry.find("medium.transmission").name == "medium.transmission"
    assert registry.origin("medium.transmission").startswith("fogpipe ")


def test_local_files_hold_the_stages_of_their_subject():
    registry = Registry([TOY_STAGES])
    assert registry.find("toy.farther").name == "toy.farther"
    assert registry.origin("toy.farther").endswith("toy.py")


def test_an_unknown_stage_gets_a_suggestion():
    with pytest.raises(UnknownStageError, match=r'Did you mean "medium\.transmission"'):
        Registry().find("medium.transmision")


def test_a_broken_plugin_is_named_only_when_it_is_needed():
    registry = Registry([TOY_STAGES, BROKEN_STAGES])
    assert registry.find("toy.farther")
    assert not registry.failures
    with pytest.raises(UnknownStageError, match=r"broken\.py: ModuleNotFoundError: .*a_library_that_nobody_has"):
        registry.find("broken.anything")


def test_a_broken_plugin_does_not_hide_the_others():
    registry = Registry([TOY_STAGES, BROKEN_STAGES])
    assert {"toy.farther", "medium.transmission"} <= registry.all().keys()
    assert "broken" in registry.failures


def test_a_stage_of_another_subject_in_a_local_file_is_refused_with_the_reason():
    with pytest.raises(UnknownStageError, match=r"misnamed\.…"):
        Registry([BROKEN_STAGES]).find("misnamed.same")


def test_a_missing_plugin_folder_is_an_error(tmp_path: Path):
    with pytest.raises(InputError, match="does not exist"):
        Registry([tmp_path / "nowhere"]).find("toy.farther")


def test_two_definitions_of_one_name_are_refused(tmp_path: Path):
    text = (
        "from fogpipe.ports import Range\nfrom fogpipe.stage import stage\n"
        "@stage('twice.same')\ndef a(r: Range) -> Range: ...\n@stage('twice.same')\ndef b(r: Range) -> Range: ...\n"
    )
    (tmp_path / "twice.py").write_text(text)
    with pytest.raises(UnknownStageError, match="defined twice"):
        Registry([tmp_path]).find("twice.same")


def test_a_plugin_that_ends_the_program_or_prints_disturbs_nothing(tmp_path: Path, capsys):
    (tmp_path / "exits.py").write_text("print('hello')\nimport sys\nsys.exit(3)\n")
    registry = Registry([tmp_path])
    assert "medium.transmission" in registry.all()
    assert "SystemExit" in registry.failures["exits"]
    assert capsys.readouterr().out == ""
