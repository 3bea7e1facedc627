"""From radiance to what people look at: view transform, pictures, video."""
