"""Robots of other sizes and kinds, each learned by an agent with default options."""
