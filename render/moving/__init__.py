"""Pictures of what moves: shadow rays, shared between neighbouring pixels."""
