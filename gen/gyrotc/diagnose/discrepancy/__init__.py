"""Stage 6: measured residuals and noise against what the simulation and the declaration say."""
