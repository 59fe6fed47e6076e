"""Find and name the cause of what a static map does not explain; extend the model and measure the gain."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
