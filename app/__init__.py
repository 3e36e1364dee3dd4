"""Everything a person touches: command line, session, recording, demo."""
