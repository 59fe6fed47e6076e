"""What people read: HTML pages and the pictures in them. Computes nothing new."""
