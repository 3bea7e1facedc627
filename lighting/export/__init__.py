"""Lights and environment maps for other programs.

Each format is a module that turns lights into its text; rig.py says which lights and which dome are
written, discs.py what a light is to other programs, orientation.py how directions and maps are
turned; files.py writes them.
"""
