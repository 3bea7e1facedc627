"""What the literature says of image-based lighting, measured again."""
