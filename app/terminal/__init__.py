"""What a person reads in the terminal: progress, summaries, errors."""
