"""What the target computes, in numpy, operation by operation: front end, terms, map, uncertainty.

docs/numerics.md is the text that this package and libc/ both follow, to the bit. No compiled code of gyrotc is loaded.
"""
