"""Live cameras of Linux (Video4Linux 2): brackets at the highest rate that a camera allows."""
