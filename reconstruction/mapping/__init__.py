"""What the object is: its rest shape and its camera, from the first frames (paper §4)."""
