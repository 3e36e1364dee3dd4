"""What the object is: its rest shape and its camera, by the first frames (paper §4), and by keyframes of all of them."""
