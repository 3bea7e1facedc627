"""Photographs that objects are set into: their camera, their ground, and the composite."""
