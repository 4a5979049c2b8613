"""Derivatives by way of a few intermediate quantities, which makes them three times as small.

The equations of motion are written in the position and velocity in an interval's middle or at its
end. These are simple expressions of the variables, but of nearly all of them, so that derivatives by
the variables repeat the equations of motion for every one of them. Here the derivatives are by the
intermediate quantities, and the chain rule does the rest.
"""

from __future__ import annotations

from typing import Any


class Lifted:
    """Expressions that were replaced by symbols, and derivatives that know of them.

    What is lifted is an expression of the variables alone, not of other lifted symbols.
    """

    def __init__(self) -> None:
        self.symbols: list[Any] = []
        self.expressions: list[Any] = []

    def __call__(self, expression: Any) -> Any:
        """A symbol that stands for the expression from here on."""
        import casadi as ca

        dense = ca.densify(expression)
        symbol = ca.SX.sym(f"lifted_{len(self.symbols)}", dense.numel())
        self.symbols.append(symbol)
        self.expressions.append(dense)
        return symbol

    def put_back(self, expressions: list[Any]) -> list[Any]:
        """The expressions without the symbols."""
        import casadi as ca

        if not self.symbols:
            return expressions
        return list(ca.substitute(expressions, [self._symbol], [self._expression]))

    def jacobian(self, rows: Any, variables: Any) -> Any:
        """The whole derivative of rows by the variables."""
        import casadi as ca

        direct = ca.jacobian(rows, variables)
        if not self.symbols:
            return direct
        through = ca.mtimes(ca.jacobian(rows, self._symbol), self._slope(variables))
        return self.put_back([direct + through])[0]

    def hessian(self, value: Any, variables: Any) -> tuple[Any, Any]:
        """The whole second derivative of a value by the variables, and the first."""
        import casadi as ca

        if not self.symbols:
            found, slope = ca.hessian(value, variables)
            return found, slope
        count = variables.numel()
        inner, first = ca.hessian(value, ca.vertcat(variables, self._symbol))
        by_symbols = first[count:]
        slope = self._slope(variables)
        # How the lifted expressions bend, weighted by what the value takes from each.
        weights = ca.SX.sym("weights", by_symbols.numel())
        bend, _ = ca.hessian(ca.dot(weights, self._expression), variables)
        bend = ca.substitute(bend, weights, by_symbols)
        cross = ca.mtimes(inner[:count, count:], slope)
        through = ca.mtimes(slope.T, ca.mtimes(inner[count:, count:], slope))
        whole = inner[:count, :count] + cross + cross.T + through + bend
        whole = ca.triu2symm(ca.triu(whole))
        return tuple(self.put_back([whole, first[:count] + ca.mtimes(slope.T, by_symbols)]))

    @property
    def _symbol(self) -> Any:
        import casadi as ca

        return ca.vertcat(*self.symbols)

    @property
    def _expression(self) -> Any:
        import casadi as ca

        return ca.vertcat(*self.expressions)

    def _slope(self, variables: Any) -> Any:
        import casadi as ca

        return ca.jacobian(self._expression, variables)
