"""What leaves the laboratory with a unit: its certificate, and its correction in other forms."""
