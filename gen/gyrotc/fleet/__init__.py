"""Many units: a manifest of data sets in, a verified table for each and one summary out."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
