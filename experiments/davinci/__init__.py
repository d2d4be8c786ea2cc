"""A measured cable drive: what its transmission does."""
