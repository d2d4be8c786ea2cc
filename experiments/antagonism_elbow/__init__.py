"""Antagonism Updater on the elbow: antagonistic muscles pull less (Fig. 9)."""
