"""Small linear systems inside kernels."""

from __future__ import annotations

from colift.kernel.jit import inline


@inline
def solve_symmetric(xx, xy, xz, yy, yz, zz, bx, by, bz):  # type: ignore[no-untyped-def]
    """Solve a positive definite 3 by 3 system, by the adjugate."""
    cxx = yy * zz - yz * yz
    cxy = xz * yz - xy * zz
    cxz = xy * yz - xz * yy
    cyy = xx * zz - xz * xz
    cyz = xy * xz - xx * yz
    czz = xx * yy - xy * xy
    scale = 1.0 / (xx * cxx + xy * cxy + xz * cxz)
    return (
        scale * (cxx * bx + cxy * by + cxz * bz),
        scale * (cxy * bx + cyy * by + cyz * bz),
        scale * (cxz * bx + cyz * by + czz * bz),
    )
