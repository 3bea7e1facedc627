"""From device counts to radiance, in camera pixels.

Frames, brackets, recordings, camera files, the sensor model and the HDR merge.
"""
