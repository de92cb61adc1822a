"""What every kernel is made of: signals, ports through which a kernel sees and writes them."""
