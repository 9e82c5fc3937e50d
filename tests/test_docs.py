"""What the pages say is true: their pipelines are valid, their commands exist, their stages keep their promises."""

from __future__ import annotations

import functools
import importlib.util
import inspect
import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import typer
import yaml
from typer.testing import CliRunner

from fogpipe.cli.main import app
from fogpipe.cli.options import load_pipeline
from fogpipe.io.camera import OWN_KEYS, camera_from_mapping
from fogpipe.io.encodings import ENCODINGS
from fogpipe.io.samples import sample_named
from fogpipe.io.scenes import KEYS as SCENE_KEYS
from fogpipe.pipeline.cards import card, card_data
from fogpipe.registry import Registry
from fogpipe.stage import Contract
from fogpipe.testing import check_stage

ROOT = Path(__file__).resolve().parents[1]
DOCS = sorted(page for page in (ROOT / "docs").rglob("*.md") if not {"stages", "_build"} & {*page.parts})
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *ROOT.glob("plugins/*/README.md"), *DOCS]
OWN_STAGES = [stage for stage in Registry().all().values() if stage.function.__module__.startswith("fogpipe.")]


def relative(page: Path) -> str:
    return str(page.relative_to(ROOT))


every_page = pytest.mark.parametrize("page", PAGES, ids=relative)
every_stage = pytest.mark.parametrize("stage", OWN_STAGES, ids=lambda stage: stage.name)


def blocks(page: Path, *languages: str) -> list[str]:
    """The fenced code blocks of a page in these languages."""
    found = re.findall(r"^```(\w+)\n(.*?)^```$", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    return [text for language, text in found if language in languages]


def stage_modules(page: Path) -> dict[str, str]:
    """The code blocks that declare stages, by the subject that they must be found under."""
    texts = [text for text in blocks(page, "python") if "@stage(" in text]
    return {re.findall(r'@stage\("(\w+)\.', text)[0]: text for text in texts}


def pipelines(page: Path) -> list[str]:
    return [text for text in blocks(page, "yaml") if "fogpipe:" in text]


def commands(page: Path) -> Iterator[list[str]]:
    """The command lines of a page that call fogpipe, as words."""
    for text in blocks(page, "console", "bash", "sh", "shell"):
        for line in text.replace("\\\n", " ").splitlines():
            for command in line.removeprefix("$ ").split("&&"):
                words = shlex.split(command, comments=True)
                if words[:1] == ["fogpipe"]:
                    yield words[1:]


@pytest.fixture
def here(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory as the page has it: its stages and pipelines as files, and the repository's plugins."""
    (tmp_path / "stages").mkdir()
    (tmp_path / "plugins").symlink_to(ROOT / "plugins")
    for subject, text in stage_modules(page).items():
        (tmp_path / "stages" / f"{subject}.py").write_text(text, encoding="utf-8")
    for text in pipelines(page):
        if named := re.match(r"# (\S+\.yaml)\n", text):
            (tmp_path / named[1]).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def folders(here: Path, page: Path) -> list[Path]:
    """Where the stages of the page are: its own, those of the example pack, and those that new-plugin writes."""
    found = [here / "stages"]
    for subject in ("onnx", "graphcut"):
        if page.parent.name == f"fogpipe-{subject}" and subject not in Registry().sources:
            pytest.skip(f"the pack fogpipe-{subject} is not installed")
    if "sensor" not in Registry().sources:
        found.append(ROOT / "plugins" / "fogpipe-sensor" / "fogpipe_sensor")
    for words in commands(page):
        if words[0] == "new-plugin":
            assert CliRunner().invoke(app, words).exit_code == 0
            found.append(here / f"fogpipe-{words[1]}" / f"fogpipe_{words[1]}")
    return found


@every_page
def test_every_pipeline_is_valid(page: Path, folders: list[Path]):
    for text in pipelines(page):
        Path("page.yaml").write_text(text, encoding="utf-8")
        assert load_pipeline("page.yaml", plugins=folders).graph.outputs


@every_page
def test_every_other_yaml_is_a_scene_file(page: Path):
    for text in blocks(page, "yaml"):
        if text not in pipelines(page):
            scene = yaml.safe_load(text)
            assert scene.keys() <= set(SCENE_KEYS)
            assert scene["encoding"] in ENCODINGS
            assert camera_from_mapping(scene["camera"], str(page)).matrix.shape == (3, 3)


@every_page
def test_every_json_is_a_camera(page: Path):
    for text in blocks(page, "json"):
        camera = json.loads(text)
        assert camera.keys() <= set(OWN_KEYS)
        assert camera_from_mapping(camera, str(page)).matrix.shape == (3, 3)


@every_page
def test_every_python_block_is_python_and_every_stage_in_it_is_found(page: Path, here: Path):
    for text in blocks(page, "python"):
        compile(text, str(page), "exec")
    registry = Registry([here / "stages"])
    for text in stage_modules(page).values():
        for name in re.findall(r'@stage\("([\w.]+)"', text):
            assert registry.find(name).summary


def test_the_stages_of_the_how_to_keep_the_promises_of_a_stage(tmp_path: Path):
    modules = stage_modules(ROOT / "docs" / "how-to" / "write-a-stage.md")
    for subject, text in modules.items():
        (tmp_path / f"{subject}.py").write_text(text, encoding="utf-8")
    found = [stage for name, stage in Registry([tmp_path]).all().items() if name.partition(".")[0] in modules]
    assert len(found) == len(modules) > 0
    for stage in found:
        check_stage(stage.function, parameters={p.name: 1.0 for p in stage.parameters if p.default is p.empty})


@every_page
def test_every_command_line_is_accepted(page: Path, folders: list[Path]):
    for words in commands(page):
        verb, values = parsed(words)
        if verb in ("run", "check", "plan", "draw"):
            loaded = load_pipeline(values["pipeline"], values["settings"], folders)
            assert loaded.plan(values.get("to")).nodes
            given = {text.partition("=")[0] for text in values.get("inputs") or ()}
            assert given <= loaded.graph.inputs.keys(), words
        if verb == "show":
            assert Registry(folders).find(values["name"])
        if (values.get("scene") or "").startswith("sample:"):
            assert sample_named(values["scene"].split(":")[1])
        assert values.get("depth") in (None, *ENCODINGS), words


@every_page
def test_every_verb_in_a_sentence_exists(page: Path):
    verbs = {command.name for command in app.registered_commands}
    for span in re.findall(r"`fogpipe ([^`]+)`", page.read_text(encoding="utf-8")):
        assert span.split()[0] in verbs or span.startswith("-"), span


def parsed(words: list[str]) -> tuple[str, dict[str, Any]]:
    """The verb of a command line and its arguments, as the command line would take them; nothing is run."""
    taken: list[tuple[str, dict[str, Any]]] = []

    def recorder(name: str, command: Any) -> Any:
        @functools.wraps(command)
        def record(**values: Any) -> None:
            taken.append((name, values))

        return record

    recording = typer.Typer()
    for command in app.registered_commands:
        recording.command(command.name)(recorder(str(command.name), command.callback))
    ended = CliRunner().invoke(recording, words)
    assert ended.exit_code == 0, f"fogpipe {shlex.join(words)}\n{ended.output}"
    return taken[0]


@pytest.mark.parametrize("page", [page for page in PAGES if page not in DOCS], ids=relative)
def test_every_link_to_a_file_leads_there(page: Path):
    for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):  # Sphinx checks those in docs
        assert (page.parent / target).exists(), target


def test_the_readme_prints_the_commands_that_ci_runs():
    printed = "".join(blocks(ROOT / "README.md", "console", "bash", "sh", "shell")).splitlines()
    assert "pip install . && fogpipe run hansard2019 --scene sample:motorcycle -o out" in printed
    assert 'pip install -e ".[test]" && pytest' in printed


def test_every_verb_has_a_section_with_its_help():
    page = (ROOT / "docs" / "reference" / "command-line.md").read_text(encoding="utf-8")
    for command in app.registered_commands:
        assert f"## {command.name}\n\n{{{{ help_{str(command.name).replace('-', '_')} }}}}" in page


@every_stage
def test_every_stage_has_a_card_that_documents_all_of_it(stage: Contract):
    data = card_data(stage)
    assert data["summary"].endswith(".")
    for port, item in zip(stage.inputs, data["inputs"], strict=True):
        # An undocumented port is described by its kind alone.
        assert item["description"] != port.kind.meaning, f"{stage.name}: {port.name}"
    for item in (*data["outputs"], *data["parameters"]):
        assert item["description"], f"{stage.name}: {item['name']}"
    assert f"# {stage.name}" in card(stage)


@every_stage
def test_the_page_of_a_stage_is_markdown(stage: Contract):
    page = card(stage)
    assert not re.search(r":\w+:`|^\.\. ", page, flags=re.MULTILINE)
    assert page.count("$$") == 2 * (inspect.getdoc(stage.function) or "").count(".. math::")


@pytest.fixture(scope="module")
def generated() -> ModuleType:
    """The module that makes pages and tables for Sphinx."""
    spec: Any = importlib.util.spec_from_file_location("generated", ROOT / "docs" / "generated.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_stage_pages_come_and_go_with_their_stages(generated: ModuleType, tmp_path: Path):
    (tmp_path / "gone.stage.md").write_text("a stage that was removed")
    generated.write_stage_pages(tmp_path)
    assert {page.stem for page in tmp_path.iterdir()} == {"index", *(stage.name for stage in OWN_STAGES)}


def test_every_table_that_a_page_names_is_made(generated: ModuleType):
    named = {name for page in DOCS for name in re.findall(r"\{\{ (\w+) \}\}", page.read_text(encoding="utf-8"))}
    assert named == generated.tables().keys()
