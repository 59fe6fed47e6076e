"""What is said of a result: figures through the compiled code, findings, limits, uncertainty budget, changes."""
