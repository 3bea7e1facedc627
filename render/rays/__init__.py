"""Rays against a scene's triangles, and what they find."""
