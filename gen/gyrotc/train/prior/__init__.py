"""Prior of a gyro's map: from similar units, or from its own earlier calibration (docs/lot.md)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
