"""`gyrotc plan`: what a programmed profile will show, before the chamber is booked."""
