"""What is rendered: meshes, materials, the camera, and tables of them for compiled loops."""
