"""Every stage of fogpipe keeps the promises of a stage."""

from __future__ import annotations

import importlib

import pytest

from fogpipe.stage import is_stage
from fogpipe.testing import check_stage

SUBJECTS = (
    "airlight",
    "blur",
    "composite",
    "denoise",
    "density",
    "depth",
    "haze",
    "haziness",
    "layers",
    "medium",
    "metric",
    "noise",
    "participating",
    "prior",
    "range",
    "refine",
    "restore",
    "scattering",
    "segments",
    "sky",
    "structure",
)
STAGES = {
    stage.__stage__.name: stage
    for subject in SUBJECTS
    for stage in vars(importlib.import_module(f"fogpipe.stages.{subject}")).values()
    if is_stage(stage)
}


@pytest.mark.parametrize("name", STAGES)
def test_contract(name):
    check_stage(STAGES[name])


@pytest.mark.parametrize("name", STAGES)
def test_the_name_says_where_to_find_it(name):
    subject, _, verb = name.partition(".")
    assert STAGES[name] is getattr(importlib.import_module(f"fogpipe.stages.{subject}"), verb)
