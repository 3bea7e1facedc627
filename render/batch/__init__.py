"""Many recordings by many processes: cut into runs of frames, tracked, and written once each."""
