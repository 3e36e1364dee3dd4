"""What frames come from: files by two decoders, numbered images, cameras and streams."""
