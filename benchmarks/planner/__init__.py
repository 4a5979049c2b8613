"""What a plan costs, beside other solvers on the same problem."""
