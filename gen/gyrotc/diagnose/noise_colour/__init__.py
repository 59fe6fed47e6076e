"""Stage 2: covariance of noise: its colours, what a unit declares, whitening."""
