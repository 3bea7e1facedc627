"""Ways to place lights of equal power where the light is."""
