"""Networks of the hand detector and their training, by PyTorch, in a process of their own.

The process must not draw: Triton, which PyTorch imports, crashes after Mesa has drawn.
"""
