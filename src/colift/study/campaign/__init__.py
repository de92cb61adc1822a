"""Many flights as one campaign: planned, flown by workers, kept in one file.

``plan`` turns cases into jobs that are named by a hash of all that decides the flight, ``workers`` flies
jobs on this machine or on a Dask cluster, ``store`` keeps results in one SQLite file, ``engine`` puts the
three together. ``compare`` and ``sweep`` are campaigns; ``judge`` says who is best at what.
"""
