"""Diagnosis: what the simulation gets wrong, the named cause, the extended model, the measured gain."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
