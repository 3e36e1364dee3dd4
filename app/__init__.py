"""Everything a person touches: the command line, the frame loop, recordings and what is made from them."""
