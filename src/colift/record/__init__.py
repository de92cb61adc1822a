"""What a flight leaves behind, and what is read from it: needs no part and no kernel."""
