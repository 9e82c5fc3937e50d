"""Inputs and outputs at URLs: in memory, from a web server, and in an object store that speaks S3."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from fogpipe.batch.journal import read_state
from fogpipe.batch.places import place_at
from fogpipe.batch.run import Batch, Watcher, run_batch
from fogpipe.errors import InputError, OutputError

from .conftest import OPTIONS, contents

fsspec = pytest.importorskip("fsspec", reason="fogpipe[remote] is not installed")
Make = Callable[..., Batch]
SWEEP = {"sweeps": ["extinction.visibility=20,40"], "also": ["transmission", "record"]}


@pytest.fixture
def memory() -> Iterator[str]:
    """The URL of an empty folder in memory."""
    system = fsspec.filesystem("memory")
    system.store.clear()
    yield "memory://bucket"
    system.store.clear()


def upload(folder: Path, url: str) -> None:
    system, base = fsspec.core.url_to_fs(url)
    for path in folder.rglob("*"):
        if path.is_file():
            system.pipe_file(f"{base}/{path.relative_to(folder).as_posix()}", path.read_bytes())


def downloaded(url: str, folder: Path) -> dict[str, str]:
    system, base = fsspec.core.url_to_fs(url)
    for path in system.find(base):
        target = folder / path.removeprefix(base).lstrip("/")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(system.cat_file(path))
    return contents(folder)


def pixels(found: dict[str, str]) -> dict[str, str]:
    """Without the manifests, which name the places of the sources."""
    return {name: digest for name, digest in found.items() if not name.startswith("manifest")}


def test_from_url_to_url_gives_the_same_bytes_and_resumes(
    photos: Callable[..., Path], make_batch: Make, memory: str, tmp_path: Path
):
    data = photos(4)
    run_batch(make_batch(data, tmp_path / "here", **SWEEP))
    upload(data, f"{memory}/photos")
    batch = partial(make_batch, f"folder:{memory}/photos", f"{memory}/out", reader_options=OPTIONS, **SWEEP)
    assert run_batch(batch(shard=(1, 2))).made == 4
    assert run_batch(batch()).made == 4
    assert run_batch(batch()).made == 0
    assert pixels(downloaded(f"{memory}/out", tmp_path / "there")) == pixels(contents(tmp_path / "here"))
    fsspec.filesystem("memory").rm("/bucket/out/images/0001_visibility20.png")
    assert run_batch(batch()).made == 1


def test_a_picture_that_is_not_there_costs_its_item(
    photos: Callable[..., Path], make_batch: Make, memory: str, tmp_path: Path
):
    upload(photos(3), f"{memory}/photos")
    batch = make_batch(f"folder:{memory}/photos", tmp_path / "out", reader_options=OPTIONS)
    fsspec.filesystem("memory").rm("/bucket/photos/depth/0001.png")
    summary = run_batch(batch)
    assert summary.made == 2
    assert "memory://bucket/photos/depth/0001.png: there is nothing at this address" in summary.failed["0001"]


def test_nothing_at_an_address_is_one_clear_error(make_batch: Make, memory: str, tmp_path: Path):
    with pytest.raises(InputError, match="there is no such folder, or it holds no files"):
        make_batch(f"folder:{memory}/nowhere", tmp_path / "out", reader_options=OPTIONS)
    with pytest.raises(InputError, match="cannot be listed"):
        make_batch("folder:nosuch://place", tmp_path / "out", reader_options=OPTIONS)


@pytest.fixture
def web(photos: Callable[..., Path]) -> Iterator[str]:
    """The URL of photos on a web server of this machine."""
    pytest.importorskip("aiohttp", reason="aiohttp, by which fsspec reads http, is not installed")

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(photos(3))))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


def test_processes_read_a_table_and_what_it_names_from_a_web_server(web: str, make_batch: Make, tmp_path: Path):
    rows = [f"{n:04},images/{n:04}.png,{web}/depth/{n:04}.png,kitti,labels/{n:04}.txt\n" for n in range(3)]
    table = tmp_path / "photos" / "set.csv"
    table.write_text("id,image,range_map,encoding,labels\n" + "".join(rows))
    summary = run_batch(make_batch(f"csv:{web}/set.csv", tmp_path / "there", engine="processes", workers=2))
    assert (summary.made, summary.failed) == (3, {})
    run_batch(make_batch(f"csv:{table}", tmp_path / "here", labels="copy"))
    assert pixels(contents(tmp_path / "there")) == pixels(contents(tmp_path / "here"))


def test_a_web_server_that_lists_its_files_is_a_folder(web: str, make_batch: Make, tmp_path: Path):
    summary = run_batch(make_batch(f"folder:{web}", tmp_path / "out", reader_options=OPTIONS))
    assert (summary.made, summary.failed) == (3, {})
    assert (tmp_path / "out/labels/0002.txt").read_text() == "0 2\n"


def test_a_place_that_cannot_be_written_to_is_known_before_anything_runs(web: str, make_batch: Make, tmp_path: Path):
    class Silent(Watcher):
        def started(self, todo):
            raise AssertionError("it ran")

    batch = partial(make_batch, tmp_path / "photos")
    with pytest.raises(OutputError, match=r"http://.*1-of-1.*cannot be written: .*501"):
        run_batch(batch(f"{web}/out"), Silent())
    with pytest.raises(OutputError, match=r"nosuch://place: cannot be written to: .*nosuch"):
        run_batch(batch("nosuch://place"), Silent())


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The URL of a bucket in a server that speaks S3."""
    server_module = pytest.importorskip("moto.server", reason="moto, a server that speaks S3, is not installed")
    pytest.importorskip("s3fs", reason="s3fs is not installed")
    server = server_module.ThreadedMotoServer("127.0.0.1", port=0)
    server.start()
    host, port = server.get_host_and_port()
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "test")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    system = fsspec.filesystem("s3", skip_instance_cache=True)
    system.mkdir("fog")
    yield "s3://fog"
    server.stop()


@pytest.mark.filterwarnings("ignore")  # of boto3 and its server
def test_processes_write_to_an_object_store(bucket: str, photos: Callable[..., Path], make_batch: Make, tmp_path: Path):
    data = photos(3)
    run_batch(make_batch(data, tmp_path / "here", **SWEEP))
    upload(data, f"{bucket}/photos")
    options = {**SWEEP, "reader_options": OPTIONS, "engine": "processes", "workers": 2}
    summary = run_batch(make_batch(f"folder:{bucket}/photos", f"{bucket}/out", **options))
    assert (summary.made, summary.failed) == (6, {})
    assert len(read_state(place_at(f"{bucket}/out")).rows) == 6
    assert pixels(downloaded(f"{bucket}/out", tmp_path / "there")) == pixels(contents(tmp_path / "here"))
