"""Sandbox for untrusted files: checks the paths that they name, and reads them in a worker process.

MuJoCo's compiler and readers of bags trust their input: a hostile file can make them crash, hang,
fill the memory or read files elsewhere. This package imports none of our packages and is quick to
import, so it also has the parent watchdog of worker processes and the atomic writer of files.
"""
