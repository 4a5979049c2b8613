"""``aloft linearise``: the linear model of a graph about one instant, and the margins of an opened loop."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....cli.shared.options import AsJson, Overrides
from ....cli.shared.output import (
    console,
    errors_reported,
    number,
    print_json,
    say,
    table,
)
from ....runtime.language.errors import AloftError

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from .. import FrequencyResponse, Linearisation, Margins, RootLocus

MOST_POLES = 12


def linearise(
    graph: Annotated[str, typer.Argument(help="The graph file.")],
    inputs: Annotated[
        list[str],
        typer.Option("--input", help="A signal, such as pd.command.torque[*_knee]. Repeatable."),
    ],
    outputs: Annotated[
        list[str] | None,
        typer.Option("--output", help="A signal that is observed; by default those of --input."),
    ] = None,
    at: Annotated[float | None, typer.Option(help="The instant [s].")] = None,
    when: Annotated[
        str, typer.Option(help="The first instant at which it holds: 'phase.phase == STAND'.")
    ] = "",
    opened: Annotated[
        bool,
        typer.Option(
            "--open", help="Open the loop at --input. Without --output this gives margins."
        ),
    ] = False,
    locus: Annotated[
        str,
        typer.Option(help="The poles over one parameter and its range: pd.kp=10:200, 20 values."),
    ] = "",
    steps: Annotated[int, typer.Option(min=2, help="With --locus: how many values.")] = 20,
    chirp: Annotated[
        str,
        typer.Option(
            help="Also measure the responses: add a chirp of this root mean square, 50 mN m."
        ),
    ] = "",
    band: Annotated[
        str, typer.Option(help="With --chirp: its frequencies [Hz], the lowest and the highest.")
    ] = "1:50",
    period: Annotated[
        float, typer.Option(help="With --chirp: the time after which it repeats itself [s].")
    ] = 1.0,
    periods: Annotated[
        int, typer.Option(min=1, help="With --chirp: how many periods of a run count.")
    ] = 4,
    seeds: Annotated[
        str, typer.Option(help="With --chirp: the seeds of the runs, 1000:1005 or 3.")
    ] = "1000:1005",
    png: Annotated[
        Path | None, typer.Option(help="Draw Bode and Nyquist diagrams, or the locus, here.")
    ] = None,
    svg: Annotated[Path | None, typer.Option(help="The same as SVG.")] = None,
    overrides: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Linearise a whole graph about an instant: A, B, C, D, poles, and the margins of an opened loop."""
    from ....runtime.graph import load
    from ....studies.batch.seeds import parse_seeds
    from .. import frequency_responses, margins, root_locus
    from .. import linearise as linearise_graph
    from ..locus import locus_figure
    from ..loop_margins import margins_figure

    with errors_reported(as_json):
        if at is None and not when:
            raise AloftError("say about which instant: --at 0.4 or --when 'phase.phase == STAND'")
        if locus and opened:
            raise AloftError("a locus has the poles of the loop as it runs: leave out --open")
        if locus and chirp:
            raise AloftError(
                "--chirp measures responses, --locus traces poles: ask for one of them"
            )
        if locus:
            traced = root_locus(
                graph, locus, inputs=inputs, outputs=outputs or inputs, steps=steps,
                overrides=overrides or [], at=at, when=when,
            )  # fmt: skip
            draw(lambda: locus_figure(traced, f"{Path(graph).stem}: poles"), png, svg)
            show_locus(traced, graph, as_json)
            return
        loop = opened and (outputs is None or outputs == inputs)
        if (png or svg) and not loop:
            raise AloftError("diagrams show an opened loop: give --open and no --to")
        loaded = load(graph, overrides or [])
        model = linearise_graph(
            loaded, inputs=inputs, outputs=outputs or inputs, at=at,
            when=when, opened=opened,
        )  # fmt: skip
        found = margins(model) if loop else None
        measured: list[FrequencyResponse] = []
        if chirp:
            low, high = band_of(band)
            try:
                chosen = parse_seeds(seeds)
            except AloftError:
                raise AloftError(
                    f"--seeds cannot be {seeds!r}; write it as --seeds 1000:1005"
                ) from None
            measured = [
                each
                for signal in inputs
                for each in frequency_responses(
                    loaded, inputs=signal, outputs=() if loop else outputs or inputs,
                    at=model.tick * model.base_period, size=chirp, low=low, high=high, period=period,
                    periods=periods, seeds=chosen,
                )
            ]  # fmt: skip
        if found is not None:
            title = f"{Path(graph).stem} at {model.tick * model.base_period:.3f} s"
            points = {each.source: each for each in measured}
            draw(lambda: margins_figure(found, title, list(points), points), png, svg)
    if as_json:
        about: dict[str, Any] = {} if found is None else {"margins": found.as_data()}
        told = [
            each.as_data() | {"within": each.holds(predicted(model, each)).tolist()}
            for each in measured
        ]
        about |= {"measured": told} if chirp else {}
        print_json({"success": True, "graph": graph, **model.as_data(), **about})
        return
    show(console(), model, found)
    show_measured(console(), model, measured)


def band_of(text: str) -> tuple[float, float]:
    """Parse the frequencies of ``low:high``. Raises ``AloftError``."""
    try:
        low, high = map(float, text.split(":"))
    except ValueError:
        low, high = 1.0, 0.0
    if not low <= high:
        raise AloftError(f"--band cannot be {text!r}; write it as --band 1:50")
    return low, high


def predicted(model: Linearisation, measured: FrequencyResponse) -> Any:
    """Compute the model's prediction of a measured response, (frequencies,)."""
    from ..loop_margins import loop_responses

    w = 2.0 * math.pi * measured.frequency
    names = list(dict.fromkeys(name.partition("@")[0] for name in model.inputs))
    if measured.opened:
        return loop_responses(model, w)[:, names.index(measured.source)]
    targets = list(dict.fromkeys(name.partition("@")[0] for name in model.outputs))
    return model.response(w)[:, targets.index(measured.target), names.index(measured.source)]


def show_measured(
    out: Console, model: Linearisation, measured: Sequence[FrequencyResponse]
) -> None:
    """Print the responses beside the model's."""
    for each in measured:
        values = predicted(model, each)
        rows = [
            (number(f), number(abs(v)), number(abs(g)), number(r), number(c))
            for f, v, g, r, c in zip(
                each.frequency, values, each.value, each.radius, each.coherence, strict=True
            )
        ]
        to = "its opened loop" if each.opened else each.target
        title = f"{each.source} to {to}: {each.samples} periods with a chirp"
        columns = (">Hz", ">model", ">measured", ">within 95 %", ">coherence")
        out.print(table(title, columns, rows))
        share = sum(each.holds(values).tolist())
        say(out, f"the model lies within the intervals at {share} of {len(rows)} frequencies")


def draw(make: Callable[[], Figure], png: Path | None, svg: Path | None) -> None:
    """Write the diagrams that ``make`` draws. Raises ``AloftError`` if a file cannot be written."""
    from ....plotting import image, style, svg_text

    if png is None and svg is None:
        return
    with style():
        figure = make()
        try:
            if svg is not None:
                svg.write_text(svg_text(figure), encoding="utf-8")
            if png is not None:
                image(figure).save(png, format="PNG")
        except OSError as error:
            raise AloftError(f"cannot write the diagrams: {error}") from error


def show_locus(traced: RootLocus, graph: str, as_json: bool) -> None:
    """Print the slowest pole at each value, and where the loop comes to its limit."""
    if as_json:
        print_json({"success": True, "graph": graph, **traced.as_data()})
        return
    rows = [
        (number(value), f"{pole.real:.6f}", f"{pole.imag:.6f}", f"{abs(pole):.6f}")
        for value, pole in zip(traced.values, traced.leading, strict=True)
    ]
    value = f">{traced.parameter} [{traced.unit}]" if traced.unit else f">{traced.parameter}"
    out = console()
    out.print(table("slowest pole but for drift", (value, ">real", ">imaginary", ">size"), rows))
    limits = ", ".join(f"{number(each)} {traced.unit}".strip() for each in traced.limits)
    say(
        out,
        f"the limit of stability is at {limits}" if limits else "no mode begins to grow",
    )


def show(out: Console, model: Linearisation, found: Margins | None) -> None:
    """Print what matters of a model, and what it leaves out."""
    say(out, f"at {model.tick * model.base_period:.3f} s: {len(model.states)} states, "
        f"{len(model.inputs)} inputs, {len(model.outputs)} outputs, period {model.period * 1e3:g} ms "
        f"({model.unused} elements of state do not lie between them)")  # fmt: skip
    poles = model.poles if found is None else found.poles
    rows = [(f"{p.real:.6f}", f"{p.imag:.6f}", f"{abs(p):.6f}") for p in poles[:MOST_POLES]]
    title = "slowest poles" if found is None else "slowest poles of the closed loop"
    out.print(table(title, (">real", ">imaginary", ">size"), rows))
    if found is not None:
        loops = {**found.channels, "all at once": found.together}
        lines = [
            (name, number(m.gain_up), number(m.gain_down), number(m.phase), number(m.delay * 1e3),
             number(m.crossover), number(m.disk), number(m.sensitivity_peak))
            for name, m in loops.items()
        ]  # fmt: skip
        columns = ("loop", ">gain up", ">gain down", ">phase [deg]", ">delay [ms]",
                   ">crossover [rad/s]", ">disk", ">peak of S")  # fmt: skip
        out.print(table("margins, each channel with the others closed", columns, lines))
        state = "stable" if found.stable else "unstable"
        say(out, f"the closed loop is {state}; its fastest mode grows by {found.growth:.3g} 1/s")
    for each in model.held:
        say(out, f"held: {each}")
    for name, error in model.uncertain.items():
        say(
            out,
            f"uncertain: {name}: the slope is not the same on both sides, or rounded ({error:.2g})",
        )
