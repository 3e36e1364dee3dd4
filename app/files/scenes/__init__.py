"""Moving meshes as files for other programs."""
