"""A sheet that bends and does not stretch: its shapes from its keyframes alone, by lengths."""
