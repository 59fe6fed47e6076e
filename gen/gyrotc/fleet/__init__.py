"""Many units: a manifest of data sets in, a verified table for each and one summary out."""
