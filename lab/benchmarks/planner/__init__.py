"""Cost of a plan, beside other solvers on the same problem."""
