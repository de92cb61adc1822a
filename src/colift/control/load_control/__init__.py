"""Load control: the total force that the cables should exert (paper section 2.2)."""
