"""One file for each format of loggers that is no text: how it is recognised, and what opens it (`FORMAT`)."""
