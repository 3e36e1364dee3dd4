"""`modeshape reproduce`: the paper's experiments on the data at hand."""
