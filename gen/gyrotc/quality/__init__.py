"""Whether recordings are sound: facts of runs, findings, events, and the report of `gyrotc check`."""
