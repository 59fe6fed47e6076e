"""Comparison of all results of the generator with those of a reference commit: `make oracle`."""
