"""Effect of each part of the method, and a test of the paper's claims."""
