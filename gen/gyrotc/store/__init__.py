"""Writing: result folders and files that appear whole or not at all, markers, locks, caches."""
