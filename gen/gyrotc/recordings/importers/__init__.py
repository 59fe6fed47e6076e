"""Files of loggers become data sets: a module for each format, and what they share (docs/import.md)."""
