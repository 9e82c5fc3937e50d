"""``fogpipe``: the command line.

Every verb is one module of this package. Nothing heavy is imported before a verb runs, so that
``fogpipe --help`` answers at once.
"""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from fogpipe.cli import batch, bench, check, datasets, draw, new_plugin, plan, replay, run, schema, show, stages
from fogpipe.errors import FogpipeError

app = typer.Typer(
    name="fogpipe",
    help="Adds fog and haze to images, and takes them away again.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
_debug = False


def _version(wanted: bool) -> None:
    if wanted:
        import fogpipe

        typer.echo(f"fogpipe {fogpipe.__version__}")
        raise typer.Exit


@app.callback()
def options(
    debug: Annotated[bool, typer.Option("--debug", help="Show the full traceback of an error.")] = False,
    _: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")] = False,
) -> None:
    """Options before the verb."""
    global _debug
    _debug = debug


for module in (run, batch, check, plan, draw, stages, datasets, show, schema, bench, replay, new_plugin):
    name = module.__name__.rpartition(".")[2].replace("_", "-")
    first_line = (module.command.__doc__ or "").partition("\n")[0]
    app.command(name, short_help=first_line)(module.command)


def main() -> None:
    """Run the command line. Exit codes: 0 good, 1 the run failed, 2 the request was wrong, 130 interrupted."""
    try:
        app()
    except FogpipeError as error:
        _report(error, error.exit_code)
    except BrokenPipeError:
        sys.exit(1)
    except Exception as error:
        if _debug:
            raise
        what = f"{type(error).__name__}: {error}"
        print(f"fogpipe met a fault of its own: {what}\nRun 'fogpipe --debug …' for the traceback.", file=sys.stderr)
        sys.exit(1)


def _report(error: FogpipeError, code: int) -> None:
    if _debug:
        import traceback

        traceback.print_exception(error)
    print(error, file=sys.stderr)
    sys.exit(code)
