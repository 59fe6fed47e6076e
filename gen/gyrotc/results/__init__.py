"""The JSON results as typed objects: one class writes a result, and pages and lines read the same class.

docs/FORMAT.md and the JSON Schemas beside these modules are made from the classes (`make formats`).
"""
