"""How far off a shape may be."""
