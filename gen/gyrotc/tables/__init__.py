"""From a model to a table, and from a table to C files; states what rounding costs."""
