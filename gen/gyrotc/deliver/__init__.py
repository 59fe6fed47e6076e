"""What leaves the laboratory with a unit: its certificate."""
