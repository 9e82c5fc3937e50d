"""`import fogpipe` brings in nothing heavy: the cost is what it imports, not a number of milliseconds."""

from __future__ import annotations

import subprocess
import sys

HEAVY = ["numpy", "scipy", "cv2", "numba", "skimage", "pydantic", "networkx", "typer", "rich", "yaml", "PIL"]


def imported_by(statement: str) -> set[str]:
    program = f"import sys; {statement}; print(' '.join(name for name in {HEAVY!r} if name in sys.modules))"
    output = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    return set(output.split())


def test_importing_fogpipe_imports_no_library():
    assert imported_by("import fogpipe") == set()


def test_the_command_line_imports_no_library_of_numbers_before_a_verb_runs():
    assert imported_by("import fogpipe.cli.main") <= {"typer", "rich"}


def test_a_stage_can_be_imported_without_the_framework():
    assert not imported_by("from fogpipe.stages.medium import transmission") & {"pydantic", "networkx", "typer", "yaml"}


def test_the_public_names_are_there():
    import fogpipe

    for name in fogpipe.__all__:
        assert getattr(fogpipe, name) is not None
    assert set(dir(fogpipe)) == set(fogpipe.__all__)
