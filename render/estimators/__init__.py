"""Every way of the literature to estimate ∫ L V f cos θ dω, on the same scenes, to be compared."""
