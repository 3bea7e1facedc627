"""Light over blocks of the lat-long grid, of a map or a camera picture: what reductions cut up."""
