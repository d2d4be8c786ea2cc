"""Structure of the transmission of a measured cable drive."""
