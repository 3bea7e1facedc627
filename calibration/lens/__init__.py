"""A lens calibrated from pictures of a board: start, adjustment, choice of model, uncertainty."""
