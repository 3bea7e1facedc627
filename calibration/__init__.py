"""Between pixels and directions: camera models and what is known about one camera."""
