"""The Markov random field of Guo 2014: its energy, and solvers that say how far they may be from the least one.

To add a solver, write a function that takes a :class:`Field`, the gap at which it may stop and the largest number
of passes, and gives a :class:`Solution`; name it in :data:`SOLVERS`.
"""

from __future__ import annotations

from collections.abc import Callable

from fogpipe.kernels.mrf.chains import chains
from fogpipe.kernels.mrf.columns import columns
from fogpipe.kernels.mrf.energy import Cost, Field, Solution, energy
from fogpipe.kernels.mrf.icm import icm
from fogpipe.kernels.mrf.trws import trws

__all__ = ["SOLVERS", "Cost", "Field", "Solution", "energy"]

SOLVERS: dict[str, Callable[[Field, float, int], Solution]] = {
    "chains": chains,
    "columns": lambda field, target_gap, passes: columns(field),
    "trws": trws,
    "icm": icm,
}
"""Solvers by the name that the stage gives them."""
