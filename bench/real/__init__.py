"""Measured recordings with runs or spans left out: the figures of docs/real.md (`make real`)."""
