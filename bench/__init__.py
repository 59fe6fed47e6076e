"""gyrotc beside its peers: `make bench` runs this package in an environment of its own and rewrites docs/results.md."""
