"""Pure functions over arrays that blocks share: rotations, polynomials, filters, programs."""
