#!/bin/sh
# do-mpc 5.1.2: `LinearModel.discretize` loses the matrix D. It computes all four matrices and builds the discrete model of A, B and C: what a measurement takes from the input at once is zero. An accelerometer,
# a force or a current sensor has such a part, and it is the greatest of it. LQR, simulator and estimators of the discrete model have another plant than those of the continuous one.
# Expected, by scipy's cont2discrete and by hand: D is the same in both. A mass of 2 kg with 1 N s/m of friction, at rest, pushed with 2 N: its accelerometer reads 1 m/s^2.
# Seen: D = 0.5 in the continuous, 0 in the discrete model; the first readings after 0.1 and 0.2 s are -0.05 and -0.10 m/s^2 in place of 0.95 and 0.90: a push forward reads as a push back.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check do-mpc==5.1.2 casadi==3.8.2 numpy==2.4.6 scipy==1.17.1
MPLCONFIGDIR="$folder" "$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import do_mpc
import numpy as np
from scipy.signal import cont2discrete

MASS, FRICTION, PUSH, STEP = 2.0, 1.0, 2.0, 0.1
rate, gain = np.array([[-FRICTION / MASS]]), np.array([[1 / MASS]])  # the sensor reads the rate of the speed
model = do_mpc.model.LinearModel("continuous")
model.set_variable("_x", "speed")
model.set_variable("_u", "push")
model.setup(A=rate, B=gain, C=rate, D=gain)
sampled = model.discretize(STEP)
wanted = cont2discrete((rate, gain, rate, gain), STEP)


def readings(plant):
    simulator = do_mpc.simulator.Simulator(plant)
    simulator.settings.t_step = STEP
    simulator.setup()
    simulator.x0 = np.zeros((1, 1))
    return [float(simulator.make_step(np.array([[PUSH]]))[0, 0]) for _ in range(3)]


exact = PUSH / MASS * np.exp(-FRICTION / MASS * STEP * np.arange(1, 4))
told = {"continuous": readings(model), "discrete": readings(sampled)}
print(f"do-mpc {do_mpc.__version__}: D is {model.sys_D[0, 0]} in the continuous and {sampled.sys_D[0, 0]} in the discrete model, {wanted[3][0, 0]} by scipy")
for name, numbers in {"closed form": exact, **told}.items():
    print(f"  accelerometer of three steps, {name}: {np.round(numbers, 4)} m/s^2")
same = all(np.allclose(ours, theirs) for ours, theirs in zip((sampled.sys_A, sampled.sys_B, sampled.sys_C), wanted[:3], strict=True))
right = np.allclose(told["continuous"], exact, atol=1e-4) and np.allclose(wanted[3], model.sys_D)
sys.exit(0 if same and right and not sampled.sys_D.any() and max(told["discrete"]) < 0 else 1)
CODE
