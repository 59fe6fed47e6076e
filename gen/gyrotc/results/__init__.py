"""The JSON results as typed objects: one class writes a result, and pages and lines read the same class.

`gyrotc schema` and the tables of fields in the manual are made from the classes (`cli/shell.py`).
"""
