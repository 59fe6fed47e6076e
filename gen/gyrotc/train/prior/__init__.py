"""What gyros of one type share: learning it, using it for a unit with few runs, planning with it (docs/lot.md)."""
