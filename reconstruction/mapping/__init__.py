"""What the object is: its rest shape and its camera, by keyframes of all frames."""
