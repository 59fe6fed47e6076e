"""From a model to a table, and from a table to C files; states what rounding costs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
