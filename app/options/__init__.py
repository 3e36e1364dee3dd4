"""What a person can choose; nothing heavy is imported here, so that `--help` is instant."""
