"""Stage 7: the map refitted beside the causes, and what that gains on runs it has not seen."""
