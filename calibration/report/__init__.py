"""A page that shows how good a lens calibration is, and what to photograph to better it."""
