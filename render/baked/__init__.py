"""Pictures of what stands still: visibility is traced once, light is multiplied with it."""
