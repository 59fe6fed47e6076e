"""The command `gyrotc`."""
