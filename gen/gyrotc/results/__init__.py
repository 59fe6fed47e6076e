"""JSON results as typed objects: one class writes a result, and pages and commands read the same class.

`gyrotc schema` and the tables of fields in the manual are made from the classes (`cli/schema.py`).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
