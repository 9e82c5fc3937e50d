"""Fixtures that the whole suite shares."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from textwrap import dedent
from typing import Any

import pytest
from hypothesis import settings

from fogpipe.pipeline.check import check
from fogpipe.pipeline.graph import Graph
from fogpipe.pipeline.spec import read_spec
from fogpipe.registry import Registry


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real images that are not part of the repository."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not (folder / "README.md").is_file():
        pytest.skip("the folder of real images, ../shared/data beside the checkout, is not here")
    return folder


# The first example of a test may compile a kernel, which no deadline of milliseconds can allow for.
settings.register_profile("fogpipe", deadline=None)
settings.load_profile("fogpipe")

TOY_STAGES = Path(__file__).parent / "toy_stages"
BROKEN_STAGES = Path(__file__).parent / "broken_stages"


@pytest.fixture
def registry() -> Registry:
    """fogpipe's own stages and the toy stages of the tests."""
    return Registry([TOY_STAGES])


@pytest.fixture
def build(registry: Registry) -> Callable[..., Graph]:
    """Checks a pipeline that is given as text; the line ``fogpipe: 1`` is added."""

    def build(text: str, **overrides: Any) -> Graph:
        return check(read_spec("fogpipe: 1\n" + dedent(text), "test.yaml", overrides.get("set")), registry)

    return build


@pytest.fixture
def toy(registry: Registry) -> Any:
    """The module of the toy stages, with an empty list of calls."""
    module = sys.modules[registry.find("toy.farther").function.__module__]
    module.calls.clear()
    return module
