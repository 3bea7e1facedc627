"""Pictures by OpenGL: the context, the G-buffer, shadow maps."""
