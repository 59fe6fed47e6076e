"""`gyrotc plan`: what a programmed profile will show, before the chamber is booked."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
