"""Where the surface is in the picture: given by hand, or found by what moves together."""
