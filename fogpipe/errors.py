"""Every error that fogpipe raises on purpose.

* FogpipeError
  - RequestError                the request was wrong; nothing was run (exit code 2)
    · PipelineError             one or more problems in a pipeline file
    · ContractError             a function that is not a valid stage
    · UnknownStageError         no such stage, or its plugin cannot be imported
    · InputError                an input file, array, camera or scene cannot be used
  - RunError                    the run was started and failed (exit code 1)
    · StageError                a stage raised; wraps it once, with what it was given
    · OutputError               an output could not be written; the old file is intact
    · ExpectationError          the run finished but missed what the pipeline expects
    · ReplayError               a replayed run gave other bytes than the recorded one

A message says what is wrong, where, and what to do. It never holds array contents.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass


class FogpipeError(Exception):
    """The root of all errors that fogpipe raises on purpose."""

    exit_code = 1


class RequestError(FogpipeError):
    """The request was wrong; nothing was run."""

    exit_code = 2


@dataclass(frozen=True, slots=True, order=True)
class Problem:
    """One thing wrong in a pipeline file.

    Attributes
    ----------
    line, column : position in the file, counted from 1; 0 where the problem has no place.
    where : dotted path of the item, such as ``stages.haze.in.range_map``.
    what : what is wrong, and what to do.
    """

    line: int
    column: int
    where: str
    what: str

    def describe(self, source: str) -> str:
        """The problem as text: ``file:line:column  where`` and the indented explanation."""
        place = f"{source}:{self.line}:{self.column}" if self.line else source
        indented = "\n".join(f"  {line}" for line in self.what.splitlines())
        return f"{place}  {self.where}\n{indented}"


class PipelineError(RequestError):
    """One or more problems in a pipeline; all of them are reported at once.

    Attributes
    ----------
    source : name of the file or of the shipped pipeline.
    problems : every problem found, in the order of the file.
    """

    def __init__(self, source: str, problems: Sequence[Problem]) -> None:
        self.source = source
        self.problems = tuple(sorted(problems))
        count = len(self.problems)
        body = "\n".join(problem.describe(source) for problem in self.problems)
        super().__init__(f"{body}\n{count} problem{'s' if count != 1 else ''}; nothing was run.")


class ContractError(RequestError):
    """A function whose signature does not make a valid stage."""


class UnknownStageError(RequestError):
    """No such stage, or the plugin that should hold it cannot be imported."""


class InputError(RequestError):
    """An input file, array, camera or scene cannot be used."""


class RunError(FogpipeError):
    """The run was started and failed."""


class StageError(RunError):
    """A stage raised an exception; the original is the ``__cause__``."""


class OutputError(RunError):
    """An output could not be written. A file that was there before is unchanged."""


class ExpectationError(RunError):
    """The run finished, but a value missed what the pipeline's ``expect`` asks for.

    Attributes
    ----------
    result : what was computed all the same (a :class:`fogpipe.Result`).
    """

    def __init__(self, message: str, result: object = None) -> None:
        self.result = result
        super().__init__(message)


class ReplayError(RunError):
    """A replayed run gave other bytes than the run that was recorded."""


def closest(word: str, known: Iterable[str]) -> str | None:
    """The known word that is most like ``word``, or None if none is."""
    import difflib

    return next(iter(difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)), None)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`` Did you mean "x"?`` for the known word nearest to ``word``, or an empty string."""
    meant = closest(word, known)
    return f' Did you mean "{meant}"?' if meant else ""


def suggestion(word: str, known: Iterable[str]) -> str:
    """What :func:`did_you_mean` says, or else a list of all that there is."""
    names = list(known)
    return did_you_mean(word, names) or (f" There is: {', '.join(names)}." if names else "")
