"""The bytes of an input, from a file or from a URL."""

from __future__ import annotations

import pytest

from fogpipe.errors import InputError
from fogpipe.io.camera import read_camera
from fogpipe.io.files import file_name, is_url, read_bytes


def test_a_url_is_told_from_a_path():
    assert is_url("s3://bucket/a.png")
    assert not is_url("/data/a.png")
    assert file_name("s3://bucket/deep/a.png") == "a.png"


def test_a_url_is_read_like_a_file(tmp_path):
    fsspec = pytest.importorskip("fsspec", reason="fogpipe[remote] is not installed")
    system = fsspec.filesystem("memory")
    system.pipe_file("/cameras/c.json", b'{"fx": 7, "fy": 7, "cx": 3, "cy": 2}')
    system.pipe_file("/cameras/empty", b"")
    assert read_camera("memory://cameras/c.json").matrix[0, 0] == 7
    with pytest.raises(InputError, match="memory://cameras/empty: is empty"):
        read_bytes("memory://cameras/empty")
    with pytest.raises(InputError, match="there is nothing at this address"):
        read_bytes("memory://cameras/none")
    with pytest.raises(InputError, match="cannot be read: ValueError"):
        read_bytes("nosuch://cameras/none")
    system.rm("/cameras", recursive=True)
