"""Views of a session: MuJoCo's viewer, a page for a browser, a video, and a progress bar."""
