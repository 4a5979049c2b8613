"""Sine, cosine, arc tangent, arc cosine, exponential, logarithm, hyperbolic tangent and hypotenuse, with the same bits on every processor.

The C libraries of systems, processors and browsers differ in the last bit of these functions. Here they are made of additions,
products, quotients and square roots alone, which IEEE 754 defines to the last bit, without fused operations. All errors are below 1 ULP, the
distance of neighbouring numbers.

Where one number is not enough, a value is the unevaluated sum of two, ``high + low`` with |low| at most half an ULP of ``high``
(T. J. Dekker, A floating-point technique for extending the available precision, Numerische Mathematik 18, 1971). Polynomials are interpolations at
Chebyshev nodes: of (sin r / r - 1) / r^2, (cos r - 1 + r^2 / 2) / r^4, (e^r - 1 - r - r^2 / 2) / r^3 and (atan t / t - 1) / t^2.
"""

from __future__ import annotations

import math

from .kernel import kernel

_HALF_PI, _HALF_PI_LOW = 1.5707963267948966, 6.123233995736766e-17
_PI_1, _PI_2, _PI_3, _PI_4 = (
    1.5707963407039642, -1.3909067675399456e-08, 6.123233932053594e-17, 6.36831716351095e-25,
)  # fmt: skip
"""Half of pi in parts of 26 bits, whose products with whole numbers below 2^27 are exact."""
_TURNS = 0.6366197723675814
_SHARE = 67108864.0
"""2^26, the quarter turns that a first reduction takes at a time."""
_LN2_1, _LN2_2, _LN2_3 = 0.6931471806019545, -4.200915072890502e-11, 2.0941744292700725e-21
_ATAN_HALF, _ATAN_HALF_LOW = 0.4636476090008061, 2.2698777452961687e-17
_SPLIT = 134217729.0
"""2^27 + 1: Veltkamp's splitting of a number into halves of 26 bits."""


@kernel
def two_sum(a: float, b: float) -> tuple[float, float]:
    """Compute ``a + b`` exactly, as a sum of two numbers (D. E. Knuth, The Art of Computer
    Programming 2, 4.2.2)."""
    high = a + b
    part = high - a
    return high, (a - (high - part)) + (b - part)


@kernel
def two_product(a: float, b: float) -> tuple[float, float]:
    """Compute ``a b`` exactly, as a sum of two numbers, where nothing leaves the range (Dekker)."""
    high = a * b
    x, y = _SPLIT * a, _SPLIT * b
    a_high, b_high = x - (x - a), y - (y - b)
    a_low, b_low = a - a_high, b - b_high
    return high, ((a_high * b_high - high) + a_high * b_low + a_low * b_high) + a_low * b_low


@kernel
def _less_turns(
    high: float, low: float, rest: float, turns: float, unit: float
) -> tuple[float, float, float]:
    """``high + low + rest`` without so many quarter turns of ``unit`` each."""
    for k in range(4):
        part = _PI_1 if k == 0 else (_PI_2 if k == 1 else (_PI_3 if k == 2 else _PI_4))
        high, error = two_sum(high, -(turns * (unit * part)))
        low, error = two_sum(low, error)
        rest += error
    high, low = two_sum(high, low)
    return high, low, rest


@kernel
def reduce_angle(angle: float) -> tuple[float, float, int]:
    """Reduce an angle [rad] to its distance from the nearest quarter turn, as a sum of two numbers,
    and the index of that quarter turn.

    Not a number beyond 2^53, where neighbouring numbers are more than a radian apart.
    """
    if abs(angle) <= 0.7853981633974483:
        return angle, 0.0, 0
    if not abs(angle) < 9007199254740992.0:
        return math.nan, 0.0, 0
    if abs(angle) < 1048576.0:
        turns = math.floor(angle * _TURNS + 0.5)
        high, low = two_sum(angle - turns * _PI_1, -(turns * _PI_2))
        if abs(high) > 1e-6:
            high, low = two_sum(high, low - turns * _HALF_PI_LOW)
            return high, low, turns % 4
    high, low, rest = angle, 0.0, 0.0
    if abs(angle) > _SHARE:
        turns = math.floor(angle / (_SHARE * _HALF_PI) + 0.5)
        high, low, rest = _less_turns(high, low, rest, float(turns), _SHARE)
    turns = math.floor(high * _TURNS + 0.5)
    high, low, rest = _less_turns(high, low, rest, float(turns), 1.0)
    high, low = two_sum(high, low + rest)
    return high, low, turns % 4


@kernel
def _sine(r: float, low: float) -> float:
    z = r * r
    series = -0.16666666666666666 + z * (
        0.008333333333333331 + z * (-0.00019841269841264567 + z * (2.7557319218954762e-06 + z * (
            -2.505210610025599e-08 + z * (1.6058510875319195e-10 - z * 7.585486485235938e-13)
        )))
    )  # fmt: skip
    return r + (r * (z * series) + low * (1.0 - 0.5 * z))


@kernel
def _cosine(r: float, low: float) -> float:
    z = r * r
    series = 0.041666666666666664 + z * (
        -0.0013888888888887241 + z * (2.480158729853226e-05 + z * (
            -2.7557317151858866e-07 + z * (2.0876121534608454e-09 - z * 1.1380868171449914e-11)
        ))
    )  # fmt: skip
    half = 0.5 * z
    high = 1.0 - half
    return high + (((1.0 - high) - half) + (z * z * series - r * low))


@kernel
def sin(angle: float) -> float:
    """Return the sine of an angle [rad]."""
    if abs(angle) < 1e-9:
        return angle
    r, low, quarter = reduce_angle(angle)
    value = _sine(r, low) if quarter % 2 == 0 else _cosine(r, low)
    return value if quarter < 2 else -value


@kernel
def cos(angle: float) -> float:
    """Return the cosine of an angle [rad]."""
    r, low, quarter = reduce_angle(angle)
    value = _cosine(r, low) if quarter % 2 == 0 else _sine(r, low)
    return value if quarter == 0 or quarter == 3 else -value


@kernel
def sincos(angle: float) -> tuple[float, float]:
    """Sine and cosine of an angle [rad], with the bits of ``sin`` and ``cos``."""
    if abs(angle) < 1e-9:
        return angle, 1.0
    r, low, quarter = reduce_angle(angle)
    a, b = _sine(r, low), _cosine(r, low)
    if quarter % 2 == 1:
        a, b = b, -a
    return (a, b) if quarter < 2 else (-a, -b)


@kernel
def _first_octant(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """Return the arc tangent of (a + a_low) / (b + b_low), between 0 and 1, as a sum of two
    numbers.

    Of the angles 0, atan 1/2 and pi/4 one near is taken off: tan(x - y) = (tan x - tan y) / (1 + tan x tan y).
    """
    tangent, start, start_low = 0.0, 0.0, 0.0
    if a > 0.75 * b:
        tangent, start, start_low = 1.0, 0.7853981633974483, 3.061616997868383e-17
    elif a > 0.25 * b:
        tangent, start, start_low = 0.5, _ATAN_HALF, _ATAN_HALF_LOW
    top, top_low = two_sum(a, -(tangent * b))
    bottom, bottom_low = two_sum(b, tangent * a)
    top_low += a_low - tangent * b_low
    bottom_low += b_low + tangent * a_low
    t = top / bottom
    high, low = two_product(t, bottom)
    rest = ((top - high) - low + top_low - t * bottom_low) / bottom
    z = t * t
    series = -0.3333333333333333 + z * (
        0.19999999999999982 + z * (-0.1428571428570453 + z * (0.1111111110911075 + z * (
            -0.09090908882297034 + z * (0.07692295169091659 + z * (-0.06666207458454339 + z * (
                0.058718714023867545 + z * (-0.0511693551226967 + z * 0.03600731817976272)
            )))
        )))
    )  # fmt: skip
    angle, error = two_sum(start, t)
    return angle, error + (start_low + (rest + t * (z * series)))


@kernel
def _angle_of(y: float, y_low: float, x: float, x_low: float) -> float:
    """Return the angle of the point (x + x_low, y + y_low) with y not below zero, from 0 to pi."""
    side, side_low = (x, x_low) if x >= 0.0 else (-x, -x_low)
    if y <= side:
        high, low = _first_octant(y, y_low, side, side_low)
    else:
        high, low = _first_octant(side, side_low, y, y_low)
        high, error = two_sum(_HALF_PI, -high)
        low = error + (_HALF_PI_LOW - low)
    if x < 0.0:
        high, error = two_sum(2.0 * _HALF_PI, -high)
        low = error + (2.0 * _HALF_PI_LOW - low)
    return high + low


@kernel
def atan2(y: float, x: float) -> float:
    """Return the angle of the point (x, y) [rad], from -pi to pi. Signs of zeros count, as in C."""
    above, side = abs(y), abs(x)
    if math.isnan(x) or math.isnan(y):
        return math.nan
    if math.isinf(above) or math.isinf(side):
        # the direction of a diagonal or of an axis
        above = 1.0 if math.isinf(above) else 0.0
        x = math.copysign(1.0 if math.isinf(side) else 0.0, x)
        side = abs(x)
    largest = max(above, side)
    if largest == 0.0:
        return math.copysign(0.0 if math.copysign(1.0, x) > 0.0 else 2.0 * _HALF_PI, y)
    if x > 0.0 and above < 1e-20 * side:
        return math.copysign(above / side, y)
    scale = 1.0
    if largest > 1e150:
        scale = 2.0**-600
    elif largest < 1e-150:
        scale = 2.0**600
    return math.copysign(_angle_of(scale * above, 0.0, scale * x, 0.0), y)


@kernel
def acos(cosine: float) -> float:
    """Return the arc cosine [rad], from 0 to pi; not a number beyond -1 and 1."""
    if not abs(cosine) <= 1.0:
        return math.nan
    less, less_low = two_sum(1.0, -cosine)
    more, more_low = two_sum(1.0, cosine)
    square, square_low = two_product(less, more)
    square_low += less * more_low + less_low * more
    if square <= 0.0:
        return 0.0 if cosine > 0.0 else 2.0 * _HALF_PI
    sine, sine_low = _root_of(square, square_low)
    return _angle_of(sine, sine_low, cosine, 0.0)


@kernel
def _root_of(high: float, low: float) -> tuple[float, float]:
    """Return the square root of ``high + low``, above zero, as a sum of two numbers."""
    root = math.sqrt(high)
    square, error = two_product(root, root)
    return root, ((high - square) - error + low) / (2.0 * root)


@kernel
def hypot(x: float, y: float) -> float:
    """sqrt(x^2 + y^2), without overflow on the way."""
    largest, least = max(abs(x), abs(y)), min(abs(x), abs(y))
    if math.isinf(x) or math.isinf(y):
        return math.inf
    if largest == 0.0 or not largest + least > 0.0:
        return largest + least
    scale = 1.0
    if largest > 1e150:
        scale = 2.0**-600
    elif largest < 1e-150:
        scale = 2.0**600
    square, low = two_product(scale * largest, scale * largest)
    other, other_low = two_product(scale * least, scale * least)
    square, error = two_sum(square, other)
    root, rest = _root_of(square, low + other_low + error)
    return (root + rest) / scale


@kernel
def _power_of_two(exponent: int) -> float:
    """2^exponent, from -1022 to 1023."""
    power, base, left = 1.0, 2.0 if exponent >= 0 else 0.5, abs(exponent)
    while left > 0:
        if left % 2 == 1:
            power *= base
        base *= base
        left //= 2
    return power


@kernel
def _exponential(x: float) -> tuple[float, float, int]:
    """e^x - 1 without its power of two: (high + low) with e^x = 2^k (1 + high + low), and k."""
    k = math.floor(x * 1.4426950408889634 + 0.5)
    high, low = two_sum(x, -(k * _LN2_1))
    high, error = two_sum(high, -(k * _LN2_2))
    low += error - k * _LN2_3
    r, low = two_sum(high, low)
    z = r * r
    series = 0.16666666666666669 + r * (
        0.041666666666666664 + r * (0.008333333333329793 + r * (0.001388888888888636 + r * (
            0.00019841269864380513 + r * (2.4801587318092064e-05 + r * (2.75572664186123e-06 + r * (
                2.755728151175639e-07 + r * (2.510134692835034e-08 + r * 2.091192320685759e-09)
            )))
        )))
    )  # fmt: skip
    high, error = two_sum(r, 0.5 * z)
    return high, error + (z * r * series + low * (1.0 + r)), k


@kernel
def exp(x: float) -> float:
    """Return the exponential function."""
    if math.isnan(x):
        return math.nan
    if x > 709.782712893384:
        return math.inf
    if x < -745.2:
        return 0.0
    high, low, k = _exponential(x)
    value, error = two_sum(1.0, high)
    value += error + low
    half = k // 2
    return value * _power_of_two(half) * _power_of_two(k - half)


@kernel
def expm1(x: float) -> float:
    """e^x - 1, also where it is small."""
    if abs(x) > 40.0 or math.isnan(x):
        return exp(x) - 1.0
    if abs(x) < 1e-17:
        return x
    high, low, k = _exponential(x)
    if k == 0:
        return high + low
    power = _power_of_two(k)
    value, error = two_sum(1.0, high)
    difference, rest = two_sum(power * value, -1.0)
    return difference + (rest + power * (error + low))


@kernel
def tanh(x: float) -> float:
    """Return the hyperbolic tangent: 1 - 2 / (e^2x + 1), and (e^2x - 1) / (e^2x + 1) where it is
    small."""
    size = abs(x)
    if math.isnan(x):
        return math.nan
    if size > 20.0:
        return math.copysign(1.0, x)
    if size < 1e-9:
        return x
    high, low, k = _exponential(2.0 * size)
    power = _power_of_two(k)
    # numerator power (1 + high + low) - 1, denominator power (1 + high + low) + 1
    base, base_low = two_sum(power - 1.0, power * high)
    base_low += power * low
    top, top_low = two_sum(base, base_low)
    bottom, bottom_low = two_sum(top, 2.0)
    bottom_low += top_low
    t = top / bottom
    product, error = two_product(t, bottom)
    rest = ((top - product) - error + top_low - t * bottom_low) / bottom
    return math.copysign(t + rest, x)


@kernel
def parts_of(x: float) -> tuple[float, int]:
    """Split a number above zero into ``m`` 2^k with ``m`` from sqrt(1/2) to sqrt(2)."""
    k, scale = 0, 512
    if x < 2.2250738585072014e-308:
        x *= 2.0**54
        k = -54
    while scale > 0:
        if x >= _power_of_two(scale):
            x *= _power_of_two(-scale)
            k += scale
        elif x < _power_of_two(1 - scale):
            x *= _power_of_two(scale)
            k -= scale
        scale //= 2
    if x > 1.4142135623730951:
        x *= 0.5
        k += 1
    return x, k


@kernel
def log(x: float) -> float:
    """Return the natural logarithm: of ``m`` 2^k as k log 2 + 2 artanh((m - 1) / (m + 1)), as in
    Sun's fdlibm."""
    if not x > 0.0:
        return -math.inf if x == 0.0 else math.nan
    if math.isinf(x):
        return x
    m, k = parts_of(x)
    f = m - 1.0
    s = f / (2.0 + f)
    z = s * s
    series = z * (
        0.6666666666666735 + z * (0.3999999999940942 + z * (0.2857142874366239 + z * (
            0.22222198432149784 + z * (0.1818357216161805 + z * (
                0.15313837699209373 + z * 0.14798198605116586
            ))
        )))
    )  # fmt: skip
    half = 0.5 * f * f
    return k * 0.6931471803691238 - (
        (half - (s * (half + series) + k * 1.9082149292705877e-10)) - f
    )
