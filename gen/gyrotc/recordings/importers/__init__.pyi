from .job import ImportOptions as ImportOptions
from .job import import_files as import_files
from .map_file import Map as Map
from .map_file import load_map as load_map
from .recognise import format_of as format_of
from .stamps import Stamps as Stamps
