"""Stage 5: which causes, with which parameters, and whether they hold their own."""
