"""What is hard: made-up things and bad footage."""
