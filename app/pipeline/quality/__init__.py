"""What is said of shapes: how good they are, and how long a unit of theirs is."""
