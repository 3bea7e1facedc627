"""The live session: a camera's light while it changes, watched and steered from a browser."""
