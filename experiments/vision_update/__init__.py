"""Vision Updater: the estimate approaches the observation (Fig. 10)."""
