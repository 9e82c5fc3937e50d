"""The parts of the documentation that are made from the code: stage cards and tables.

Cards are Markdown around text from docstrings, which are reStructuredText; :func:`markdown` translates the few
forms of it that fogpipe's docstrings use.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path

import fogpipe.errors
from fogpipe.pipeline.cards import card, markdown
from fogpipe.registry import Registry
from fogpipe.stage import Contract


def own_stages() -> list[Contract]:
    """fogpipe's own stages by name, without those of plugins that happen to be installed."""
    registry = Registry()
    stages = [stage for stage in registry.all().values() if stage.function.__module__.startswith("fogpipe.")]
    if registry.failures:
        raise RuntimeError("\n".join(registry.failures.values()))
    return stages


def write_stage_pages(folder: Path) -> None:
    """One page per stage, and an index by subject; pages of stages that are gone are removed."""
    stages = own_stages()
    pages = {f"{stage.name}.md": card(stage) for stage in stages} | {"index.md": _stage_index(stages)}
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.md"):
        if old.name not in pages:
            old.unlink()
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:  # or Sphinx would read every page again
            path.write_text(text, encoding="utf-8")


def _stage_index(stages: Iterable[Contract]) -> str:
    parts = ["# Stages", "", "Every stage that comes with fogpipe. `fogpipe show NAME` prints the same cards.", ""]
    for subject, group in groupby(stages, key=lambda stage: stage.name.partition(".")[0]):
        members = list(group)
        parts += [f"## {subject}", "", _module_summary(members[0]), ""]
        parts += [
            table(("stage", "what it does"), [(f"[{s.name}]({s.name}.md)", markdown(s.summary)) for s in members])
        ]
        parts += ["", "```{toctree}", ":hidden:", "", *(stage.name for stage in members), "```", ""]
    return "\n".join(parts)


def _module_summary(stage: Contract) -> str:
    module = __import__(stage.function.__module__, fromlist=["__doc__"])
    return (module.__doc__ or "").partition("\n")[0]


def tables() -> dict[str, str]:
    """Every table that a page may name as ``{{ name }}``."""
    return {
        "datasets": _datasets(),
        "encodings": _encodings(),
        "errors": f"```text\n{fogpipe.errors.__doc__}```",
        "kinds": _kinds(),
        "pipeline_keys": _pipeline_keys(),
        "pipelines": _pipelines(),
        "samples": _samples(),
        "verbs": _verbs(),
    } | _help_texts()


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(str(cell).replace('|', chr(92) + '|') for cell in line)} |" for line in lines)


def _datasets() -> str:
    """The card of every reader of fogpipe's own, as ``fogpipe datasets NAME`` prints it, one level of headings down."""
    from fogpipe.datasets.catalogue import find_reader, readers
    from fogpipe.pipeline.cards import reader_card

    own = [name for name, source in readers().items() if source.origin.startswith("fogpipe ")]
    return "\n".join(re.sub(r"^(?=#)", "#", reader_card(name, find_reader(name)), flags=re.MULTILINE) for name in own)


def _encodings() -> str:
    from fogpipe.io.encodings import ENCODINGS

    rows = [
        (f"`{e.name}`", e.meaning, f"`{e.formula}`", e.quantity, e.codes, ", ".join(e.files), e.source)
        for e in ENCODINGS.values()
    ]
    return table(("name", "what", "formula", "geometry", "codes", "files", "laid down in"), rows)


def _kinds() -> str:
    from fogpipe.ports import known_kinds

    rows = []
    for kind in known_kinds().values():
        shapes = " or ".join(f"({', '.join(map(str, shape))})" if shape else "one number" for shape in kind.shapes)
        bounds = f"{kind.low:g} … {kind.high:g}" if kind.dtype == "float" else ""
        rows.append((kind.name, kind.meaning, kind.unit, shapes, bounds, kind.nan or "–", kind.infinity or "–"))
    return table(("kind", "meaning", "unit", "shape", "values", "NaN", "+inf"), rows)


def _pipeline_keys() -> str:
    from fogpipe.pipeline.spec import PipelineFile, StageUse

    rows = []
    for model, prefix in ((PipelineFile, ""), (StageUse, "stages.NAME.")):
        for name, field in model.model_fields.items():
            default = "required" if field.is_required() else f"`{field.default!r}`"
            rows.append((f"`{prefix}{field.alias or name}`", default, field.description or ""))
    return table(("key", "default", "meaning"), rows)


def _pipelines() -> str:
    from fogpipe import load, shipped_pipelines

    rows = []
    for name in shipped_pipelines():
        graph = load(name).graph
        inputs = ", ".join(f"{key}: {kind}" for key, kind in graph.inputs.items())
        rows.append((f"`{name}`", graph.title, inputs, ", ".join(graph.outputs)))
    return table(("name", "title", "inputs", "outputs"), rows)


def _samples() -> str:
    from fogpipe.io.samples import SAMPLES

    return table(
        ("scene", "what it shows", "options"),
        [(f"`sample:{sample.name}`", sample.title, sample.options or "–") for sample in SAMPLES.values()],
    )


def _verbs() -> str:
    from fogpipe.cli.main import app

    rows = []
    for verb in app.registered_commands:
        summary = (inspect.getdoc(verb.callback) or "").partition("\n")[0]
        rows.append((f"[{verb.name}](#{verb.name})", summary))
    return table(("verb", "what it does"), rows)


def _help_texts() -> dict[str, str]:
    """``fogpipe VERB --help`` of every verb, as code blocks, by a name that a page can use."""
    from typer.testing import CliRunner

    from fogpipe.cli.main import app

    texts = {}
    for verb in app.registered_commands:
        printed = CliRunner().invoke(app, [str(verb.name), "--help"], prog_name="fogpipe", env={"COLUMNS": "100"})
        texts[f"help_{verb.name}".replace("-", "_")] = f"```text\n{printed.output.strip()}\n```"
    return texts
