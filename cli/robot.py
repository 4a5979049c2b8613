"""``aloft robot``: look at a robot, import one, write one as URDF, identify one from a run, bring one up."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..runtime.language.errors import AloftError, ExitCode
from .shared.options import AsJson
from .shared.output import console, errors_reported, print_error, print_json, say, table
from .shared.robot_stand import stand

if TYPE_CHECKING:
    from rich.console import Console

    from ..robots.description import ReadRobot
    from ..robots.importing.new_yaml import NewYaml

robot = typer.Typer(
    name="robot",
    help="Look at a robot, import one, write one as URDF, and bring one up on a bench.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

robot.command("stand")(stand)

Name = Annotated[str, typer.Argument(help="A shipped robot, or a YAML, URDF or MJCF file.")]
ModelFile = Annotated[Path, typer.Argument(help="The URDF or MJCF file.")]


@robot.command("show")
def show(
    name: Name,
    as_json: AsJson = False,
    picture: Annotated[
        Path | None, typer.Option(help="Draw the standing robot into this .png or .svg file.")
    ] = None,
    effects: Annotated[
        bool,
        typer.Option(
            "--effects", help="List the real-robot effects that can be simulated instead."
        ),
    ] = False,
) -> None:
    """Print the tree, masses, limits, motors, feet and sensors of a robot, and what is missing."""
    from ..robots.report import report

    with _description_errors_reported(as_json):
        found = _read(name)
        about = report(found)
        if picture is not None:
            _draw(found, picture)
    if effects:
        _show_effects(about["name"], as_json)
    elif as_json:
        print_json({"success": True, **about, "picture": str(picture) if picture else None})
    else:
        _print_robot(console(), about)
        if picture is not None:
            say(console(), f"drawn to {picture}")


@robot.command("check-up")
def check_up(name: Name, as_json: AsJson = False) -> None:
    """Look for what seems wrong: masses, inertias, axes, limits, sides, standing torque, bandwidth."""
    from ..studies import check_up as looking

    with _description_errors_reported(as_json):
        found = looking.check_up(_read(name).description)
    if as_json:
        print_json({"success": True, **found})
        return
    rows = [
        (
            row["motor"],
            f"{row['peak_torque']:.4g} {row['unit']}",
            "" if row["standing_share"] is None else f"{row['standing_share']:.0%}",
            "" if row["bandwidth_hz"] is None else f"{row['bandwidth_hz']:.3g}",
        )
        for row in found["motors"]
    ]
    columns = ("motor", ">peak", ">of it for standing", ">bandwidth Hz")
    out = console()
    out.print(table(f"{found['name']}, {found['mass_kg']:.4g} kg", columns, rows))
    for remark in found["remarks"]:
        say(out, f"{remark['part']}: {remark['found']}; usual: {remark['usual']}")
    say(
        out,
        f"unusual things: {len(found['remarks'])}" if found["remarks"] else "nothing looks wrong",
    )


def _show_effects(name: str, as_json: bool) -> None:
    """Print the effects that a simulated robot can have."""
    from .shared.simulated_effects import TRIAL, effect_rows, simulated_effects

    found = simulated_effects()
    if as_json:
        print_json({"success": True, "name": name, "trial": TRIAL, "effects": found})
        return
    columns = ("robot.", "unit", ">default", f">trial {TRIAL}", "source")
    title = f"{name}: what can be simulated of a real robot"
    console().print(table(title, columns, list(effect_rows(found))))


@robot.command("import")
def import_(
    file: ModelFile,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="The YAML to write; by default named like the file."),
    ] = None,
    force: Annotated[bool, typer.Option(help="Overwrite an existing YAML.")] = False,
    as_json: AsJson = False,
) -> None:
    """Write the short YAML beside a URDF or MJCF file, filled with what can be found or guessed."""
    with _description_errors_reported(as_json):
        target, made = _imported(file, out, force)
        try:
            target.write_text(made.text, encoding="utf-8")
        except OSError as error:
            raise AloftError(f"{target} cannot be written: {error.strerror}") from error
    if as_json:
        readings = {
            each.judge: {
                "compared": each.compared, "largest_difference": each.largest, "of": each.where,
                "on_purpose": [*each.named], "not_read": each.why,
            }
            for each in made.compared
        }  # fmt: skip
        print_json(
            {"success": True, "written": str(target), "notes": made.notes, "readings": readings}
        )
        return
    from ..robots.comparison.differences import summary

    screen = console()
    say(screen, f"wrote {target}: look at each part, then `aloft robot show {target}`")
    for note in (*made.notes, *summary(made.compared)):
        say(screen, f"  - {note}")


@robot.command("export")
def export(
    name: Name,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="The file to write; by default standard output."),
    ] = None,
    urdf: Annotated[bool, typer.Option("--urdf", help="As a URDF, which is the default.")] = True,
) -> None:
    """Write a robot as a URDF: links, joints, shapes, contact points, effort and speed limits."""
    with _description_errors_reported(False):
        from ..robots.urdf_export import hull_meshes, urdf_of

        described = _read(name).description
        hulls = hull_meshes(described)
        if out is None and hulls:
            raise AloftError(
                f"{described.name} has {len(hulls)} convex hulls, which a URDF keeps in mesh files of their own; "
                "give the file to write, and they are written beside it: --out NAME.urdf"
            )
        folder = f"{out.stem}_meshes" if out is not None else ""
        text = urdf_of(described, folder)
        if out is not None:
            try:
                out.write_text(text, encoding="utf-8")
                if hulls:
                    (out.parent / folder).mkdir(exist_ok=True)
                for file, content in hulls.items():
                    (out.parent / folder / file).write_bytes(content)
            except OSError as error:
                raise AloftError(f"{out} cannot be written: {error.strerror}") from error
    if out is None:
        typer.echo(text, nl=False)


@contextmanager
def _description_errors_reported(as_json: bool) -> Iterator[None]:
    """Report errors as ``errors_reported`` does; a robot's errors are printed one by one, or listed
    in the JSON."""
    from ..robots.validation import RobotError

    with errors_reported(as_json):
        try:
            yield
        except LookupError as error:
            raise AloftError(str(error.args[0])) from error
        except RobotError as error:
            if not as_json:
                print_error(str(error))
                raise typer.Exit(ExitCode.BAD_INPUT) from error
            errors = [
                {
                    "file": description_error.file or error.file, "line": description_error.line, "column": description_error.column,
                    "path": list(description_error.path), "message": description_error.message,
                    "expected": description_error.expected, "found": description_error.found, "fix": description_error.fix,
                }
                for description_error in error.errors
            ]  # fmt: skip
            headline = str(error).splitlines()[-1]
            print_json({"success": False, "reason": headline, "errors": errors})
            raise typer.Exit(ExitCode.BAD_INPUT) from error


def _read(name: str) -> ReadRobot:
    from ..robots.description import path_of, read

    return read(path_of(name))


def _draw(found: ReadRobot, picture: Path) -> None:
    from ..robots.report import draw_robot

    try:
        draw_robot(found.description, picture)
    except (OSError, ValueError) as error:
        raise AloftError(f"no picture: {error}") from error


def _imported(file: Path, out: Path | None, force: bool) -> tuple[Path, NewYaml]:
    """Return the path of the YAML, its text and its notes. Raises ``RobotError`` for a file that is
    wrong and ``AloftError`` for one that must not be written."""
    from ..robots.description import MODEL_FILES, OTHER_FORMATS, read
    from ..robots.importing.new_yaml import new_yaml

    if file.suffix in OTHER_FORMATS:
        read(file)  # says what to do instead
    if file.suffix not in MODEL_FILES:
        kinds = ", ".join(MODEL_FILES)
        raise AloftError(f"{file} is no URDF or MJCF file: its name ends in none of {kinds}")
    if not file.is_file():
        raise AloftError(f"there is no file {file}")
    target = out or file.with_suffix(".yaml")
    if target.exists() and not force:
        raise AloftError(f"{target} is there already; --force writes over it")
    return target, new_yaml(file, target)


def _print_robot(out: Console, about: dict[str, Any]) -> None:
    from ..robots.report import RATING_UNITS

    say(out, f"{about['name']}: {about['text']}" if about["text"] else about["name"])
    say(out, f"  {about['file']}" + (f" on {about['model_file']}" if about["model_file"] else ""))
    sizes = about["dimensions"]
    say(
        out,
        f"  {about['mass_kg']:.5g} kg, {about['base_joint']} base (link {about['base']}), "
        f"{sizes['n_joints']} joints, {sizes['n_feet']} feet, {sizes['n_contacts']} contact points",
    )
    rows = [_link_row(link) for link in about["links"]]
    columns = ("link", ">kg", "joint", "kind", "axis", "limits rad", ">stands at", ">shapes")
    out.print(table("", columns, rows))
    rows = [
        (
            row["motor"] + _of_joints(row),
            *(
                f"{row[key]:.5g}" + (f" {row['units'][key]}" if row["units"][key] != unit else "")
                for key, unit in RATING_UNITS.items()
            ),
        )
        for row in about["motors"]
    ]
    columns = ("motor", ">peak N m", ">to rad/s", ">zero at rad/s", ">lasting N m",
               ">rotor kg m^2", ">friction N m", ">damping N m s")  # fmt: skip
    if rows:
        out.print(table(f"motors, profile {about['profile']}", columns, rows))
    if about["thrusters"]:
        names = ("thruster", "link", "at m", "axis", ">to N", ">moment N m/N", ">lag s")
        out.print(table("thrusters", names, [_thruster_row(each) for each in about["thrusters"]]))
    if about["feet"]:
        feet = [(f["foot"], f["kind"], f["link"], ", ".join(f["contacts"])) for f in about["feet"]]
        out.print(table("feet", ("foot", "kind", "link", "contact points"), feet))
    sensors = about["sensors"]
    imu = "an IMU" if sensors["imu"] else "no IMU"
    mounted = "".join(f", {name} ({what})" for name, what in sensors["mounted"].items())
    counted = f"{sensors['encoders']} encoders, {imu}, {sensors['switches']} switches{mounted}"
    say(out, f"sensors: {counted}")
    if about["points"]:
        say(out, f"points to push at: {', '.join(about['points'])}")
    for note in about["missing"]:
        say(out, f"note: {note}")


def _of_joints(row: dict[str, Any]) -> str:
    """Name the joints that a motor moves, where its name does not say it."""
    return "" if row["joints"] == [row["motor"]] else f" ({', '.join(row['joints'])})"


def _thruster_row(each: dict[str, Any]) -> tuple[str, ...]:
    return (
        each["thruster"], each["link"],
        *(" ".join(f"{x:.4g}" for x in each[key]) for key in ("position", "axis")),
        *(f"{each[key]:.4g}" for key in ("max_thrust", "torque_ratio", "time_constant")),
    )  # fmt: skip


def _link_row(link: dict[str, Any]) -> tuple[str, ...]:
    axis = " ".join(f"{value:.3g}" for value in link["axis"])
    limits = "none" if link["joint"] else ""
    unit = " m" if link["unit"] == "m" else ""
    if link["limits"]:
        limits = f"{link['limits'][0]:.4g} to {link['limits'][1]:.4g}{unit}"
    stands = "" if link["stands_at"] is None else f"{link['stands_at']:.4g}{unit}"
    return (
        "  " * link["depth"] + link["link"],
        f"{link['mass_kg']:.4g}",
        link["joint"],
        link["kind"],
        axis,
        limits,
        stands + (" held" if link["held"] else ""),
        str(link["shapes"]),
    )
