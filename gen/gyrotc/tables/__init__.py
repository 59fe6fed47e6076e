"""Round a model to a table and write the table as C files, with a bound of the rounding error."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
