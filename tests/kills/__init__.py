"""Jobs that are killed or let down by the disk between any two system calls, and what is left then."""
