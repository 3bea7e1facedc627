"""Camera models, one a file: each maps directions to pixels and back, past 90° too."""
