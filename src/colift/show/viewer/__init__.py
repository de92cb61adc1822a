"""See a flight: recordings become one page with a 3D replay, pictures and films.

``data`` thins a recording to what the page draws, ``events`` finds the moments worth a mark, ``page`` writes
the page and ``render`` takes its pictures. The page itself is built from ``viewer/`` at the root of the
repository into ``assets/``.
"""
