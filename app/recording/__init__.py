"""Writing a recording: what is in it, how it looks, and the viewer that shows it."""
