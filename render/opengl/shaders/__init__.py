"""GLSL sources, read through importlib.resources."""
