"""Light over blocks of the lat-long grid, from a map or a camera picture: what reductions work on."""
