"""A file appears complete, and never outside the root."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fogpipe.batch.places import place_at
from fogpipe.errors import OutputError


def test_a_file_appears_at_once_and_drafts_are_gone(tmp_path: Path):
    place = place_at(str(tmp_path / "out"), str(tmp_path / "out" / ".fogpipe" / "drafts" / "1-of-1"))
    with place.draft() as draft:
        (draft / "x").write_text("one")
        assert not (tmp_path / "out" / "a").exists()
        place.publish(draft / "x", "a/b/x.txt")
    assert (tmp_path / "out/a/b/x.txt").read_text() == "one"
    assert not draft.exists()
    place.write_text("a/b/x.txt", "two")
    assert place.read("a/b/x.txt") == b"two"
    assert place.listed("a") == ["a/b/x.txt"]
    assert place.missing(["a/b/x.txt", "a/b/y.txt"]) == {"a/b/y.txt"}


@pytest.mark.parametrize("relative", ["../x", "/x", "a/../../x", ""])
def test_no_path_leads_out(tmp_path: Path, relative: str):
    with pytest.raises(OutputError, match="not a path below"):
        place_at(str(tmp_path / "out")).write_text(relative, "x")


def test_no_link_leads_out_but_one_inside_is_followed(tmp_path: Path):
    out = tmp_path / "out"
    (out / "real").mkdir(parents=True)
    (tmp_path / "elsewhere").mkdir()
    (out / "away").symlink_to(tmp_path / "elsewhere")
    (out / "within").symlink_to(out / "real")
    place = place_at(str(out))
    with pytest.raises(OutputError, match="a link on the way leads out"):
        place.write_text("away/x", "x")
    with pytest.raises(OutputError, match="a link on the way leads out"):
        place.link(__file__, "away/deeper/x")
    place.write_text("within/x", "x")
    assert (out / "real" / "x").read_text() == "x"
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_link_in_the_place_of_a_file_is_replaced_and_not_followed(tmp_path: Path):
    out = tmp_path / "out"
    out.mkdir()
    (tmp_path / "secret").write_text("secret")
    (out / "x").symlink_to(tmp_path / "secret")
    place_at(str(out)).write_text("x", "new")
    assert (tmp_path / "secret").read_text() == "secret"
    assert not (out / "x").is_symlink()


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="the superuser may write anywhere")
def test_a_folder_that_must_not_be_written_to_is_one_clear_error(tmp_path: Path):
    (tmp_path / "out").mkdir(mode=0o500)
    with pytest.raises(OutputError, match="cannot be written"):
        place_at(str(tmp_path / "out")).write_text("x", "x")


def test_a_file_where_a_folder_must_be_is_one_clear_error(tmp_path: Path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a").write_text("a file")
    with pytest.raises(OutputError, match="cannot be written"):
        place_at(str(tmp_path / "out")).write_text("a/x", "x")


def test_labels_are_linked_to_where_they_are(tmp_path: Path):
    (tmp_path / "label.txt").write_text("7")
    place = place_at(str(tmp_path / "out"))
    place.link(str(tmp_path / "label.txt"), "l/1.txt")
    place.copy(str(tmp_path / "label.txt"), "l/2.txt")
    assert (tmp_path / "out/l/1.txt").is_symlink()
    assert (tmp_path / "out/l/1.txt").read_text() == (tmp_path / "out/l/2.txt").read_text() == "7"
