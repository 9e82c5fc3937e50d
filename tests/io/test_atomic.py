"""A file that fogpipe writes is complete or absent, and an older one survives every failure."""

from __future__ import annotations

import os
import shutil
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from fogpipe.errors import OutputError
from fogpipe.io.atomic import atomic_write

OLD = b"what was there before"


@pytest.fixture
def target(tmp_path: Path) -> Path:
    path = tmp_path / "picture.png"
    path.write_bytes(OLD)
    return path


def write(path: Path, data: bytes = b"new") -> None:
    with atomic_write(path) as temporary:
        temporary.write_bytes(data)


def only_the_old_file(target: Path) -> bool:
    return target.read_bytes() == OLD and list(target.parent.iterdir()) == [target]


def run_python(code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_the_file_appears_complete_and_alone(tmp_path):
    path = tmp_path / "new.png"
    with atomic_write(path) as temporary:
        temporary.write_bytes(b"half")
        assert temporary.suffix == ".png"
        assert temporary.parent == tmp_path
        assert not path.exists()
        temporary.write_bytes(b"whole")
    assert path.read_bytes() == b"whole"
    assert list(tmp_path.iterdir()) == [path]


def test_an_older_file_is_replaced_only_at_the_end(target):
    with atomic_write(target) as temporary:
        temporary.write_bytes(b"new")
        assert target.read_bytes() == OLD
    assert target.read_bytes() == b"new"


@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt])
def test_a_failure_inside_leaves_the_old_file(target, failure):
    def fail_half_way():
        with atomic_write(target) as temporary:
            temporary.write_bytes(b"half")
            raise failure

    with pytest.raises(failure):
        fail_half_way()
    assert only_the_old_file(target)


def test_a_full_disk_leaves_the_old_file(target):
    # A limit on the size of files makes the operating system refuse a write half-way, as a full disk does.
    code = """
import resource, signal, sys
from fogpipe.errors import OutputError
from fogpipe.io.atomic import atomic_write
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
try:
    with atomic_write(sys.argv[1]) as temporary:
        temporary.write_bytes(bytes(100_000))
except OutputError as error:
    print(error)
"""
    pytest.importorskip("resource")
    message = run_python(code, target).stdout
    assert f"{target}: cannot be written: File too large." in message
    assert "Nothing there was changed." in message
    assert only_the_old_file(target)


def test_a_disk_that_is_really_full_leaves_the_old_file(tmp_path):
    code = """
import pathlib, sys
from fogpipe.errors import OutputError
from fogpipe.io.atomic import atomic_write
target = pathlib.Path(sys.argv[1], "picture.png")
target.write_bytes(b"old")
try:
    with atomic_write(target) as temporary:
        temporary.write_bytes(bytes(100_000))
except OutputError as error:
    print(error)
print(target.read_bytes(), len(list(target.parent.iterdir())))
"""
    # A disk of 64 kB in a name space of its own: it is gone when the process ends, however it ends.
    shell = 'mount -t tmpfs -o size=64k none "$1" || exit 99; exec "$2" -c "$3" "$1"'
    command = ["unshare", "--mount", "sh", "-c", shell, "sh", str(tmp_path), sys.executable, code]
    if not shutil.which("unshare"):
        pytest.skip("no tool to mount a small disk")
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    if done.returncode == 99 or done.stderr.startswith("unshare:"):
        pytest.skip(f"this user may not mount a small disk: {done.stderr.strip()}")
    message, left = done.stdout.splitlines()
    assert "picture.png: cannot be written: No space left on device. Nothing there was changed. Free some" in message
    assert left == "b'old' 1"


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
def test_a_killed_writer_leaves_the_old_file(target):
    code = """
import os, signal, sys
from fogpipe.io.atomic import atomic_write
with atomic_write(sys.argv[1]) as temporary:
    temporary.write_bytes(b"half")
    os.kill(os.getpid(), signal.SIGKILL)
"""
    assert run_python(code, target).returncode == -signal.SIGKILL
    assert target.read_bytes() == OLD
    leftovers = [path.name for path in target.parent.iterdir() if path != target]
    assert all(name.startswith(".fogpipe-") for name in leftovers)


def test_a_failing_disk_flush_leaves_the_old_file(target, monkeypatch):
    def no_space(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", no_space)
    with pytest.raises(OutputError, match="No space left"):
        write(target)
    assert only_the_old_file(target)


@pytest.mark.skipif(hasattr(os, "geteuid") and os.geteuid() == 0, reason="root may write everywhere")
def test_an_unwritable_folder_is_named(target):
    target.parent.chmod(0o555)
    try:
        with pytest.raises(OutputError, match=r"picture\.png: cannot be written: Permission denied.*permissions"):
            write(target)
    finally:
        target.parent.chmod(0o755)
    assert only_the_old_file(target)


def test_a_refused_file_is_named(target, monkeypatch):
    def denied(*arguments: object) -> int:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patched:
        patched.setattr(os, "open", denied)
        with pytest.raises(OutputError, match=r"picture\.png: cannot be written: Permission denied.*permissions"):
            write(target)
    assert only_the_old_file(target)


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(OutputError, match=r"No such file or directory\. .* Create the folder first"):
        write(tmp_path / "nowhere" / "picture.png")


def test_a_file_as_folder_is_named(target):
    with pytest.raises(OutputError, match="Not a directory"):
        write(target / "picture.png")
    assert only_the_old_file(target)


def test_a_folder_as_file_is_refused(tmp_path):
    folder = tmp_path / "folder.png"
    folder.mkdir()
    with pytest.raises(OutputError, match="is a folder"):
        write(folder)
    assert list(tmp_path.iterdir()) == [folder]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_device_or_pipe_is_not_replaced(tmp_path):
    pipe = tmp_path / "pipe.png"
    os.mkfifo(pipe)
    with pytest.raises(OutputError, match="not a regular file"):
        write(pipe)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_a_link_is_followed(target):
    link = target.with_name("link.png")
    link.symlink_to(target)
    write(link)
    assert link.is_symlink()
    assert target.read_bytes() == b"new"


@pytest.mark.skipif(os.name != "posix", reason="needs permission bits")
def test_permissions_follow_the_umask_and_then_the_file(tmp_path):
    path = tmp_path / "picture.png"
    before = os.umask(0o027)
    try:
        write(path)
        assert stat.S_IMODE(path.stat().st_mode) == 0o640
        path.chmod(0o600)
        write(path)
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    finally:
        os.umask(before)


def test_the_longest_possible_name_works(tmp_path):
    path = tmp_path / f"{'n' * 251}.png"
    write(path)
    assert path.read_bytes() == b"new"
