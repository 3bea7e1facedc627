"""Absolute light: maps in cd/m², the lux they imply, and lamps that were clipped."""
