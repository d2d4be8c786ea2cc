"""The joint-muscle mapping: the map, its training, its prior, and the rules that move it."""
