"""What every package may use: errors, texts, opening of input files, metrics and small statistics of arrays."""
