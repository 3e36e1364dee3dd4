"""The experiments of the report, one file each."""
