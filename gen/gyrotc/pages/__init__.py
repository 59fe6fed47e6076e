"""What people read: HTML pages and the pictures in them, made from results."""
