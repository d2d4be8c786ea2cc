"""The estimate comes to what is seen (Fig. 10)."""
