"""Light-reduction methods, one a file: an environment map goes in, a light set comes out."""
