"""Moving 3-D meshes from videos of deforming surfaces."""

__version__ = "0.1.0"
