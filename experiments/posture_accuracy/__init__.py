"""Both updaters, tested on new postures (Fig. 11)."""
