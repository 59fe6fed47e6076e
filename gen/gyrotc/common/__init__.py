"""Errors, texts, opening of input files, metrics and small statistics of arrays, for every package."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
