"""A measured drive: what a mass alone gets wrong of its force."""
