"""Initial training: the map learns the nominal model (Fig. 6)."""
