"""Lights and maps as renderers take them."""
