"""Flying by hand: a mission in real time, steered from pages in the browser."""
