"""`modeshape bench`: how fast, against what people would use instead and against the physical limit."""
