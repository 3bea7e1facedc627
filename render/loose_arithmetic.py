"""Freedoms of arithmetic under which compiled loops and sums are vectorised."""

LOOSE = {"contract", "reassoc", "nnan", "ninf", "nsz", "arcp"}
"""For kernels in which nothing is NaN or infinite."""
