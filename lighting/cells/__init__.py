"""Ways to share out the sphere: each part becomes a light that holds what the part holds."""
