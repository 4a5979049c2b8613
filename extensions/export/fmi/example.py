"""A small FMU for the conformance suite and for tests, made where it is used."""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path

from ....files.pip_line import pip_line
from ....runtime.language.errors import BlockError

SLAVE = '''\
from pythonfmu3 import Fmi3Causality, Fmi3Slave, Fmi3Status, Fmi3Variability, Float64, Unit


class Spring(Fmi3Slave):
    """A mass on a damped spring, by steps of semi-implicit Euler of at most 1 ms."""

    def __init__(self, **given):
        super().__init__(**given)
        self.description = "A mass on a damped spring"
        self.register_units([
            Unit("N", kg=1, m=1, s=-2), Unit("m", m=1), Unit("m/s", m=1, s=-1), Unit("kg", kg=1),
        ])
        self.force = 0.0
        self.mass = 2.0
        self.position = 0.1
        self.speed = 0.0
        inward, outward, fixed = Fmi3Causality.input, Fmi3Causality.output, Fmi3Causality.parameter
        for name, unit, causality, text in (
            ("force", "N", inward, "what pulls at the mass"),
            ("position", "m", outward, "how far it is pulled out"),
            ("speed", "m/s", outward, "its speed"),
        ):
            self.register_variable(Float64(
                name, unit=unit, causality=causality, description=text,
                variability=Fmi3Variability.continuous,
            ))
        self.time = 0.0
        self.register_variable(Float64(
            "time", causality=Fmi3Causality.independent, description="the time",
            variability=Fmi3Variability.continuous,
        ))
        self.register_variable(Float64(
            "mass", unit="kg", causality=fixed, description="the mass",
            variability=Fmi3Variability.tunable,
        ))

    def do_step(self, time, period):
        if self.mass <= 0.0:
            self.log(f"the mass is {self.mass} kg", Fmi3Status.error)
            return False
        self.time = time + period
        parts = max(1, round(period / 1e-3))
        for _ in range(parts):
            pull = self.force - 50.0 * self.position - 0.5 * self.speed
            self.speed += period / parts * pull / self.mass
            self.position += period / parts * self.speed
        return True
'''


@lru_cache(maxsize=1)
def example_fmu() -> Path:
    """Return a mass on a spring as an FMU of FMI 3.0; its folder is removed when the process ends.

    Raises:
        BlockError: PythonFMU3, which makes it, is not installed.
    """
    try:
        from pythonfmu3.builder import FmuBuilder
    except ImportError:
        raise BlockError(f"the example needs PythonFMU3: {pip_line('fmi')}") from None
    folder = tempfile.TemporaryDirectory(prefix="aloft-example-")
    _FOLDERS.append(folder)
    script = Path(folder.name) / "aloft_example_spring.py"
    script.write_text(SLAVE, encoding="utf-8")
    return Path(
        FmuBuilder.build_FMU(
            script, folder.name, canGetAndSetFMUState=True, canSerializeFMUState=True
        )
    )


_FOLDERS: list[tempfile.TemporaryDirectory[str]] = []
