"""Lights of one frame after the other: matched, mixed, and no more than there is time for."""
