"""A local plugin whose stage bears the name of another subject."""

from fogpipe.ports import Range
from fogpipe.stage import stage


@stage("elsewhere.same")
def same(range_map: Range) -> Range:
    """Nothing."""
    return range_map
