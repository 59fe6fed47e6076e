"""Many serials: a manifest of data sets in, a verified table for each and one summary out.

Each serial is a job of its own: one that fails does not stop the others, one that is done is not done again.
"""

from .catalogue import catalogued
from .manifest import Fleet, Unit, load_manifest
from .outliers import outliers
from .page import summary_of
from .run import run_fleet
from .shards import gather, run_share, share_of

__all__ = [
    "Fleet", "Unit", "catalogued", "gather", "load_manifest", "outliers", "run_fleet", "run_share",
    "share_of", "summary_of",
]  # fmt: skip
