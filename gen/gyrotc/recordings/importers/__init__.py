"""Files of loggers become data sets: a module for each format, and what they share (docs/import.md)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
