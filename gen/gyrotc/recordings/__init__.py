"""Read recordings into a `Dataset`: files, units, runs. docs/recordings.md says what a folder may contain."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
