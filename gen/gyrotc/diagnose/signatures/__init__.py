"""Stage 3: what the static map, every cause and every alternative would show on these temperatures."""
