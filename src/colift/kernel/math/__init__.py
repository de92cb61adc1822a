"""Mathematics that several kernels share; compiled, imports nothing of colift but `jit`."""
