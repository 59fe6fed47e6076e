"""What is said of a result: figures, findings, limits, changes, and doubts about recordings."""
