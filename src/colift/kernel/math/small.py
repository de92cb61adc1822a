"""Small systems and vectors inside kernels."""

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


@inline
def cross(a, b):  # type: ignore[no-untyped-def]
    """Vector product of two triples."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inline
def matrix_times(o, numbers, v):  # type: ignore[no-untyped-def]
    """Product of the (3, 3) matrix that begins at ``numbers[o]``, row by row, with a triple."""
    return (
        numbers[o] * v[0] + numbers[o + 1] * v[1] + numbers[o + 2] * v[2],
        numbers[o + 3] * v[0] + numbers[o + 4] * v[1] + numbers[o + 5] * v[2],
        numbers[o + 6] * v[0] + numbers[o + 7] * v[1] + numbers[o + 8] * v[2],
    )
