"""One tick of the controller of a jump, beside other solvers and earlier commits."""
