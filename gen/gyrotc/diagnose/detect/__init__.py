"""Stage 4: the data against all signatures: likelihood of each noise colour, p-values, what could still hide."""
