"""How a camera stands in the world: R_world_camera from gravity, edges, the horizon or the sun."""
