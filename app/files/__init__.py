"""Files other than recordings: safe writing, videos, meshes."""
