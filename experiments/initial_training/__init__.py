"""The map learns the nominal model (Fig. 6)."""
