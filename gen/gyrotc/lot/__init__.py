"""What gyros of one type share: learning it, using it for a unit with few runs, planning with it (docs/lot.md)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
