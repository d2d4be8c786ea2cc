"""Files that strangers wrote: looked at before anybody opens what they name, tried behind a fence.

MuJoCo's compiler and the readers of bags trust their input: a hostile file makes them crash, hang,
fill the memory, or read files that are none of its business. This package knows no other one, and
is quick to import: so what ends workers whose parent was killed is here, too.
"""
