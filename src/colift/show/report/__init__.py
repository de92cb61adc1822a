"""Reports: figures and pages made from recordings, and from nothing else.

``style`` is the look, ``panels`` draw one pair of axes, ``figures`` and ``comparison`` compose them
into named figures of one and of several recordings, ``render`` turns figures into files and
``html`` into pages.
"""
