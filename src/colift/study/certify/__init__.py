"""A mission is flown until the probability of a failure is known to be below a bound.

``space`` says what differs by chance, ``trials`` flies, whole flights one by one or by ``splitting``, ``kept`` holds what is done until all is, and
``certificate`` writes down what was found, and does it once more.
"""
