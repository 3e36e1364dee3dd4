"""Reading a recording: as data, as measures, as plots, tables and overlays."""
