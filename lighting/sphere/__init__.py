"""The sphere itself: its grid, charts, smooth functions and caps, before there is any light."""
