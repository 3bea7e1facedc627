"""The ray-traced truth: direct light on a scene, by Monte Carlo, with its standard error."""
