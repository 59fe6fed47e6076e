"""Compute in numpy what the target computes, operation by operation: front end, terms, map, uncertainty.

docs/numerics.md is the text that this package and libc/ both follow, to the bit. No compiled code of gyrotc is loaded.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
