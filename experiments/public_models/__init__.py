"""Diagnosis of machines simulated from public MJCF models, each as it is and with a payload."""
