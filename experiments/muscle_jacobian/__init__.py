"""Moment arms of the map: rough or smooth (Fig. 7)."""
