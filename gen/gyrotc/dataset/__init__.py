"""Recordings on disk become a `Dataset`: files, units, spans. Nothing after this stage opens a recording.

`load` reads a folder and refuses what is wrong, `axes_of` says what `--axis` may choose, `survey` goes on
after a problem and tells all of them. What a folder may hold is written in docs/recordings.md.
"""

from .earth import earth_rate_warning
from .facts import Jump, Outlier, RunFacts, facts_of
from .load import axes_of, load, survey
from .reading import open_file
from .records import (
    Applied,
    Curve,
    Dataset,
    DeclaredNoise,
    EarthRate,
    Exclusion,
    Mark,
    Rows,
    Run,
    SharedRows,
    joined_runs,
)

__all__ = [
    "Applied",
    "Curve",
    "Dataset",
    "DeclaredNoise",
    "EarthRate",
    "Exclusion",
    "Jump",
    "Mark",
    "Outlier",
    "Rows",
    "Run",
    "RunFacts",
    "SharedRows",
    "axes_of",
    "earth_rate_warning",
    "facts_of",
    "joined_runs",
    "load",
    "open_file",
    "survey",
]
