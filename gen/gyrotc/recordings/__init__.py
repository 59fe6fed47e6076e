"""Recordings on disk become a `Dataset`: files, units, runs. docs/recordings.md says what a folder may hold."""
