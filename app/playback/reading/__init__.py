"""Reading recordings row by row, in a process of its own."""
