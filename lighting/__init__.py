"""From the picture of a sphere to lights: lat-long maps, remapping and light reduction."""
