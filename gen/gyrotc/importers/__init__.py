"""Files of loggers become data sets: `gyrotc import`.

Each format is opened by its well-kept library and becomes tables of columns (`tables`); names and units say which
column is what (`names`, `propose`); `rows` converts them chunk by chunk; `job` writes the data set and keeps the map.
How it is used is written in docs/import.md.
"""

from .job import Imported, ImportOptions, import_files
from .mapping import Map, load_map

__all__ = ["ImportOptions", "Imported", "Map", "import_files", "load_map"]
