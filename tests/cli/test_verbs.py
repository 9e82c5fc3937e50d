"""The verbs, their output and their exit codes: 0 good, 1 the run failed, 2 the request was wrong."""

from __future__ import annotations

import json
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

from fogpipe.io.images import read_image
from tests.conftest import TOY_STAGES

TOY = """\
fogpipe: 1
inputs: {image: Image, range_map: Range}
stages:
  moved: {use: toy.farther, in: {range_map: range_map}, with: {distance: 0}}
  t: {use: toy.transmission, in: {range_map: moved}}
  foggy: {use: toy.paint, in: {image: image, transmission: t}}
  score: {use: toy.mean, in: {image: foggy}}
outputs: {foggy: foggy, transmission: t, score: score}
expect: {score: "> 0.1"}
"""


@pytest.fixture
def toy_files(tmp_path: Path) -> list[str]:
    """A pipeline file and the options that give it inputs and toy stages."""
    (tmp_path / "toy.yaml").write_text(TOY)
    np.save(tmp_path / "image.npy", np.full((4, 5, 3), 0.5, np.float32))
    np.save(tmp_path / "range.npy", np.full((4, 5), 2.0, np.float32))
    files = ["-i", f"image={tmp_path / 'image.npy'}", "-i", f"range_map={tmp_path / 'range.npy'}"]
    return [str(tmp_path / "toy.yaml"), *files, "--depth", "metres-radial", "--plugins", str(TOY_STAGES)]


def test_run_writes_outputs_a_sheet_and_a_record(fogpipe_cli, toy_files, tmp_path: Path):
    ended = fogpipe_cli("run", *toy_files, "-o", tmp_path / "out")
    assert ended.code == 0, ended.err
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "foggy.png",
        "transmission.npy",
        "sheet.png",
        "run.json",
    }
    assert "moved" in ended.err
    assert "skipped: the distance is 0" in ended.err
    assert ended.out == ""


def test_run_json_goes_to_standard_output_alone(fogpipe_cli, toy_files, tmp_path: Path):
    ended = fogpipe_cli("run", *toy_files, "-o", tmp_path / "out", "--json")
    record = json.loads(ended.out)
    assert record["outputs"]["score"]["value"] == pytest.approx(0.5 * np.exp(-0.2), rel=1e-6)  # float32 arithmetic
    assert record == json.loads((tmp_path / "out" / "run.json").read_text())


def test_run_to_computes_only_that(fogpipe_cli, toy_files, tmp_path: Path):
    ended = fogpipe_cli("run", *toy_files, "-o", tmp_path / "out", "--to", "transmission", "--no-sheet")
    assert ended.code == 0, ended.err
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"transmission.npy", "run.json"}


def test_a_missed_expectation_writes_everything_and_ends_with_1(fogpipe_cli, toy_files, tmp_path: Path):
    ended = fogpipe_cli("run", *toy_files, "-o", tmp_path / "out", "--set", "t.extinction=100")
    assert ended.code == 1
    assert "expected score > 0.1" in ended.err
    assert (tmp_path / "out" / "run.json").is_file()


def test_check_lists_all_problems_with_places_and_ends_with_2(fogpipe_cli, tmp_path: Path):
    path = tmp_path / "bad.yaml"
    path.write_text(TOY.replace("toy.mean", "toy.men").replace("{image: foggy}", "{image: foggy}, with: {a: 1}"))
    ended = fogpipe_cli("check", path, "--plugins", TOY_STAGES)
    assert ended.code == 2
    assert f"{path}:7:11  stages.score.use" in ended.err
    assert ended.err.rstrip().endswith("nothing was run.")
    as_json = fogpipe_cli("check", path, "--plugins", TOY_STAGES, "--json")
    assert as_json.code == 2
    assert json.loads(as_json.out)["problems"][0]["line"] == 7


@pytest.mark.parametrize("name", ["hansard2019", "hansard2019-paper"])
def test_check_passes_the_shipped_pipelines(fogpipe_cli, name: str):
    assert fogpipe_cli("check", name).code == 0


def test_plan_tells_what_is_skipped_pruned_and_why(fogpipe_cli, toy_files):
    ended = fogpipe_cli("plan", *toy_files, "--to", "transmission")
    assert ended.code == 0
    lines = {line.split()[0]: line for line in ended.out.splitlines()}
    assert lines["moved"].endswith("skipped  the distance is 0")
    assert lines["foggy"].endswith("pruned   transmission does not need it")
    assert lines["t"].split()[2] == "runs"


def test_plan_shows_the_cache(fogpipe_cli, toy_files, tmp_path: Path):
    fogpipe_cli("run", *toy_files, "-o", tmp_path / "out", "--cache", tmp_path / "cache")
    ended = fogpipe_cli("plan", *toy_files, "--cache", tmp_path / "cache", "--json")
    fates = {row["name"]: row["fate"] for row in json.loads(ended.out)["rows"]}
    assert fates == {"moved": "skipped", "t": "cached", "foggy": "cached", "score": "cached"}


@pytest.mark.parametrize(("name", "start"), [("g.svg", "<svg"), ("g.dot", "digraph"), ("g.mmd", "flowchart")])
def test_draw_writes_the_format_of_the_suffix(fogpipe_cli, tmp_path: Path, name: str, start: str):
    assert fogpipe_cli("draw", "hansard2019", "-o", tmp_path / name).code == 0
    assert (tmp_path / name).read_text().startswith(start)


def test_draw_to_standard_output_and_unknown_format(fogpipe_cli, tmp_path: Path):
    assert fogpipe_cli("draw", "hansard2019", "--format", "dot").out.startswith("digraph")
    assert fogpipe_cli("draw", "hansard2019", "-o", tmp_path / "g.gif").code == 2


def test_stages_and_show(fogpipe_cli):
    listed = fogpipe_cli("stages")
    assert "medium.transmission" in listed.out
    shown = fogpipe_cli("show", "medium.transmission")
    assert shown.out.startswith("# medium.transmission")
    data = json.loads(fogpipe_cli("show", "medium.transmission", "--json").out)
    assert data["inputs"][0]["name"] == "range_map"
    missing = fogpipe_cli("show", "medium.transmision")
    assert missing.code == 2
    assert 'Did you mean "medium.transmission"' in missing.err


def test_schema_is_json(fogpipe_cli):
    assert json.loads(fogpipe_cli("schema").out)["title"] == "fogpipe pipeline"


def test_replay_gives_the_same_bytes(fogpipe_cli, toy_files, tmp_path: Path):
    fogpipe_cli("run", *toy_files, "-o", tmp_path / "out")
    ended = fogpipe_cli("replay", tmp_path / "out" / "run.json", "-o", tmp_path / "again")
    assert ended.code == 0, ended.err
    for name in ("foggy.png", "transmission.npy", "sheet.png"):
        assert (tmp_path / "again" / name).read_bytes() == (tmp_path / "out" / name).read_bytes()


def test_replay_refuses_changed_inputs_and_reports_changed_outputs(fogpipe_cli, toy_files, tmp_path: Path):
    fogpipe_cli("run", *toy_files, "-o", tmp_path / "out")
    path = tmp_path / "out" / "run.json"
    record = json.loads(path.read_text())
    record["outputs"]["foggy"]["digest"] = "0" * 40
    record["versions"]["numpy"] = "0.1"
    (tmp_path / "other.json").write_text(json.dumps(record))
    changed = fogpipe_cli("replay", tmp_path / "other.json", "-o", tmp_path / "again")
    assert changed.code == 1
    assert "foggy came out differently" in changed.err
    assert "numpy 0.1 →" in changed.err
    np.save(tmp_path / "range.npy", np.full((4, 5), 3.0, np.float32))
    refused = fogpipe_cli("replay", path, "-o", tmp_path / "again")
    assert refused.code == 2
    assert "range_map is not what it was" in refused.err


@pytest.mark.parametrize("content", ["", "{}", "[1]", "not json", '{"record": 99}'])
def test_replay_of_something_else_is_refused(fogpipe_cli, tmp_path: Path, content: str):
    (tmp_path / "run.json").write_text(content)
    ended = fogpipe_cli("replay", tmp_path / "run.json")
    assert ended.code == 2
    assert "run record" in ended.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "hansard2019"], "needs image"),
        (["run", "hansard2019", "--scene", "sample:motorcycle", "--cache-limit", "1"], "say --cache DIR too"),
        (["run", "hansard2091"], 'Did you mean "hansard2019"'),
        (["run", "hansard2019", "-i", "image"], "NAME=FILE"),
        (["run", "hansard2019", "-i", "imag=x.png"], 'Did you mean "image"'),
        (["run", "hansard2019", "-i", "image=nowhere.png"], "nowhere.png"),
        (["run", "hansard2019", "--scene", "sample:motorcyle"], "motorcycle"),
        (["run", "hansard2019", "--scene", "sample:motorcycle", "--to", "haze"], "hazy"),
        (["run", "hansard2019", "--scene", "sample:motorcycle", "--set", "fog.visibilty=3"], "visibility"),
        (["run", "hansard2019", "--scene", "sample:motorcycle", "--set", "fog"], "--set fog"),
        (["run", "hansard2019", "--scene", "sample:motorcycle", "--tolerance", "0"], "greater than 0"),
        (
            [
                "run",
                "hansard2019",
                "--scene",
                "sample:motorcycle",
                "--set",
                "fog.visibility=9",
                "--set",
                "fog.extinction=1",
            ],
            "only one of visibility (9.0) and extinction (1.0)",
        ),
        (["replay", "nowhere.json"], "nowhere.json: there is no such file."),
        (["run", "hansard2019", "--scene", "sample:motorcycle", "--image-format", "gif"], "png16"),
        (["run", "hansard2019", "--scene", "sample:motorcycle", "--map-format", "png"], "range is a Range [m]"),
        (["run", "hansard2019", "--scene", "sample:motorcycle", "--plugins", "nowhere"], "does not exist"),
        (["nothing"], "No such command"),
    ],
)
def test_wrong_requests_end_with_2_and_one_message(fogpipe_cli, arguments, message: str, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = fogpipe_cli(*arguments)
    assert ended.code == 2
    assert message in ended.err
    assert "Traceback" not in ended.err
    assert list(tmp_path.iterdir()) == []


def test_a_failing_stage_ends_with_1_without_a_traceback_unless_asked(fogpipe_cli, tmp_path: Path):
    (tmp_path / "bad.yaml").write_text(
        dedent("""\
        fogpipe: 1
        inputs: {range_map: Range}
        stages: {bad: {use: toy.fail, in: {range_map: range_map}}}
        outputs: {bad: bad}
        """)
    )
    np.save(tmp_path / "range.npy", np.ones((2, 2), np.float32))
    arguments = ["run", tmp_path / "bad.yaml", "-i", f"range_map={tmp_path / 'range.npy'}", "--depth", "metres-radial"]
    arguments += ["--plugins", TOY_STAGES, "-o", tmp_path / "out"]
    ended = fogpipe_cli(*arguments)
    assert ended.code == 1
    assert 'stage "bad" (toy.fail' in ended.err
    assert "Traceback" not in ended.err
    assert not (tmp_path / "out").exists()
    assert "Traceback" in fogpipe_cli("--debug", *arguments).err


def test_an_output_folder_that_is_a_file_ends_with_1(fogpipe_cli, toy_files, tmp_path: Path):
    (tmp_path / "out").write_text("mine")
    ended = fogpipe_cli("run", *toy_files, "-o", tmp_path / "out")
    assert ended.code == 1
    assert "cannot write" in ended.err
    assert (tmp_path / "out").read_text() == "mine"


def test_version_and_help(fogpipe_cli):
    assert fogpipe_cli("--version").out.startswith("fogpipe ")
    told = " ".join(fogpipe_cli("--help").out.split())
    assert "run Run a pipeline and write its outputs, a proof sheet and a record." in told
    assert "..." not in told.partition("Commands:")[2]


def test_a_camera_may_be_an_output(fogpipe_cli, tmp_path: Path):
    (tmp_path / "camera.yaml").write_text(
        dedent("""\
        fogpipe: 1
        inputs: {depth: Depth, camera: Camera}
        stages: {r: {use: range.from_depth, in: {depth: depth, camera: camera}}}
        outputs: {r: r, camera: camera}
        """)
    )
    np.save(tmp_path / "depth.npy", np.ones((2, 3), np.float32))
    (tmp_path / "camera.json").write_text('{"fx": 10, "fy": 10, "cx": 1, "cy": 1}')
    arguments = [
        "-i",
        f"depth={tmp_path / 'depth.npy'}",
        "-i",
        f"camera={tmp_path / 'camera.json'}",
        "--depth",
        "metres",
    ]
    ended = fogpipe_cli("run", tmp_path / "camera.yaml", *arguments, "-o", tmp_path / "out", "--json")
    assert ended.code == 0, ended.err
    assert json.loads(ended.out)["outputs"]["camera"]["value"][0] == [10, 0, 1]


def test_a_format_without_opacity_is_refused_before_anything_runs(fogpipe_cli, toy_files, tmp_path: Path):
    np.save(tmp_path / "image.npy", np.full((4, 5, 4), 0.5, np.float32))
    ended = fogpipe_cli("run", *toy_files, "-o", tmp_path / "out", "--image-format", "jpg")
    assert ended.code == 2
    assert "no room for the opacity" in ended.err
    assert not (tmp_path / "out").exists()


def test_opaque_leaves_the_opacity_of_the_input_away_and_a_replay_does_so_too(fogpipe_cli, toy_files, tmp_path: Path):
    np.save(tmp_path / "image.npy", np.full((4, 5, 4), 0.5, np.float32))
    for options in ([], ["--opaque"]):
        assert fogpipe_cli("run", *toy_files, "-o", tmp_path / "out", *options).code == 0
        assert (read_image(tmp_path / "out" / "foggy.png").alpha is None) == bool(options)
        assert fogpipe_cli("replay", tmp_path / "out" / "run.json", "-o", tmp_path / "again").code == 0
    assert fogpipe_cli("run", *toy_files, "-o", tmp_path / "out", "--image-format", "jpg", "--opaque").code == 0


def test_an_output_cannot_be_named_like_the_proof_sheet(fogpipe_cli, toy_files, tmp_path: Path):
    path = Path(toy_files[0])
    path.write_text(TOY.replace("outputs: {foggy: foggy", "outputs: {sheet: foggy"))
    assert "rename it" in fogpipe_cli("run", *toy_files, "-o", tmp_path / "out").err
    assert fogpipe_cli("run", *toy_files, "-o", tmp_path / "out", "--no-sheet").code == 0


def test_a_killed_run_leaves_the_older_one_whole(toy_files, fogpipe_cli, tmp_path: Path):
    import signal
    import subprocess
    import sys
    import time

    out = tmp_path / "out"
    fogpipe_cli("run", *toy_files, "-o", out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    program = "import sys; from fogpipe.cli.main import main; sys.exit(main())"
    waiting = "import fogpipe.runtime.job as job; import time; job.publish = lambda *a: time.sleep(60); "
    command = [sys.executable, "-c", waiting + program, "run", *toy_files, "-o", str(out), "--set", "t.extinction=0.01"]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while not list(out.glob(".fogpipe-run-*/run.json")) and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()} == before
    assert fogpipe_cli("run", *toy_files, "-o", out).code == 0


def test_new_plugin_does_not_take_the_name_of_a_subject_that_is_there(fogpipe_cli, tmp_path: Path):
    ended = fogpipe_cli("new-plugin", "range", "-o", tmp_path / "package")
    assert ended.code == 2
    assert "already" in ended.err


@pytest.mark.parametrize("settings", [["--seed", "-1"], ["--tolerance", "nan"], ["--set", "visibility=50"]])
def test_settings_that_cannot_be_are_refused(fogpipe_cli, settings):
    assert fogpipe_cli("run", "hansard2019", "--scene", "sample:motorcycle", *settings).code == 2
