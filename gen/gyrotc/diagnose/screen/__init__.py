"""Stage 1: recordings become blocks; outliers, uneven noise and a coarse thermometer are told before any test."""
