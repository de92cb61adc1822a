"""Everything that flows between the layers, in one table.

The loop keeps one row of numbers, the *bus*; every signal is a named view of a part of it. Writing
the row to the log records all of them at once, and this table is the legend of a recording. A new signal
is one line here: the kernels of the layer that is named as its ``writer`` find it among what they write.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def named_tuple(name: str, fields: Iterable[str], module: str) -> Any:
    """A class of named tuples, found again in ``module`` under its name, as the cache of kernels needs it."""
    return namedtuple(name, tuple(fields), module=module)


@dataclass(frozen=True)
class Signal:
    """One signal: name, shape (``"n"`` stands for the number of drones), unit, symbol, meaning."""

    name: str
    shape: tuple[int | str, ...]
    unit: str
    symbol: str
    frame: str
    meaning: str
    initial: float | tuple[float, ...] = 0.0
    """Value until the first writer; of each column, where there are several."""
    each: str = "row"
    """Recorded in each ``"row"`` of the log, or for each ``"allocation"``."""
    writer: str = ""
    """Port whose kernel writes it (:data:`colift.kernel.ports.PORTS`); none for what faults change or the loop writes."""
    dtype: type = np.float64
    """Of its array; bytes are ``np.uint8``."""

    def shape_for(self, n: int) -> tuple[int, ...]:
        """Shape with the number of drones filled in."""
        sizes = {"n": n, "n+1": n + 1}
        return tuple(sizes[size] if isinstance(size, str) else size for size in self.shape)


LEVEL = (1.0, 0.0, 0.0, 0.0)
"""The attitude of what stands level, wxyz."""

SIGNALS = (
    Signal("reference", (4, 3), "m, m/s, m/s^2, m/s^3", "x_Ld", "world", "wanted load position and three derivatives", writer="reference"),
    Signal("load", (2, 3), "m, m/s", "x_L", "world", "load position and velocity", writer="plant_observe"),
    Signal("force", (3,), "N", "u_L", "world", "wanted total force of the cables on the load", writer="load_control"),
    Signal("desired_tensions", ("n",), "N", "T_id", "-", "tensions wanted by the allocator", writer="allocation"),
    Signal("desired_directions", ("n", 3), "1", "alpha_id", "world", "unit directions drone to load wanted by the allocator", writer="allocation"),
    Signal("tensions", ("n",), "N", "T_i", "-", "actual tensions", writer="plant"),
    Signal("peak_tensions", ("n+1",), "N", "-", "-", "largest tension of each cable and, last, largest sum of them since the row before", writer="plant"),
    Signal("catch_impulses", ("n",), "N s", "-", "-", "largest impulse with which each cable came taut since the row before", writer="plant"),
    Signal("directions", ("n", 3), "1", "alpha_i", "world", "actual unit directions from drone to load", writer="plant_observe"),
    Signal("direction_rates", ("n", 3), "1/s", "alpha_dot_i", "world", "time derivatives of the directions", writer="plant_observe"),
    Signal("positions", ("n", 3), "m", "x_i", "world", "drone positions", writer="plant_observe"),
    Signal("velocities", ("n", 3), "m/s", "x_dot_i", "world", "drone velocities", writer="plant_observe"),
    Signal("attitudes", ("n", 4), "1", "q_i", "body to world", "drone attitudes, quaternion wxyz", writer="plant_observe"),
    Signal("rates", ("n", 3), "rad/s", "Omega_i", "body", "drone body rates", writer="plant_observe"),
    Signal("drone_forces", ("n", 3), "N", "u_i", "world", "wanted thrust vectors", writer="position_control"),
    Signal("thrusts", ("n",), "N", "f_i", "-", "thrust commands", writer="position_control"),
    Signal("desired_attitudes", ("n", 4), "1", "q_id", "body to world", "wanted attitudes, wxyz", writer="position_control"),
    Signal("desired_rates", ("n", 3), "rad/s", "Omega_id", "body", "wanted body rates", writer="position_control"),
    Signal("torques", ("n", 3), "N m", "tau_i", "body", "torque commands", writer="attitude_control"),
    Signal("external_forces", ("n+1", 3), "N", "d", "world", "disturbing forces on the drones and, last row, the load", writer="disturbance"),
    Signal("attached", ("n",), "1", "-", "-", "1 while a cable holds, 0 once it is cut", initial=1.0),
    Signal("slack_times", ("n",), "s", "-", "-", "time that each cable has spent without tension", writer="plant"),
    Signal("ground_forces", ("n+1", 3), "N", "-", "world", "forces of the ground on the drones and, last, the load", writer="plant"),
    Signal("touch_speeds", ("n+1",), "m/s", "-", "-", "largest downward speed with which each drone and, last, the load came onto the ground since the row before", writer="plant"),
    Signal("measured_load", (2, 3), "m, m/s", "-", "world", "load position and velocity as measured", writer="sensing"),
    Signal("measured_positions", ("n", 3), "m", "-", "world", "drone positions as measured", writer="sensing"),
    Signal("measured_velocities", ("n", 3), "m/s", "-", "world", "drone velocities as measured", writer="sensing"),
    Signal("measured_attitudes", ("n", 4), "1", "-", "body to world", "drone attitudes as measured, wxyz", writer="sensing"),
    Signal("measured_rates", ("n", 3), "rad/s", "-", "body", "drone body rates as measured", writer="sensing"),
    Signal("measured_ages", ("n+1", 3), "s", "-", "-", "time since the samples were taken: tracking, attitude and rates of the drones and, last, the load", writer="sensing"),
    Signal("estimated_load", (2, 3), "m, m/s", "-", "world", "load position and velocity that the controllers use", writer="estimation"),
    Signal("estimated_positions", ("n", 3), "m", "-", "world", "drone positions that the controllers use", writer="estimation"),
    Signal("estimated_velocities", ("n", 3), "m/s", "-", "world", "drone velocities that the controllers use", writer="estimation"),
    Signal("estimated_attitudes", ("n", 4), "1", "-", "body to world", "drone attitudes that the controllers use, wxyz", writer="estimation"),
    Signal("estimated_rates", ("n", 3), "rad/s", "-", "body", "drone body rates that the controllers use", writer="estimation"),
    Signal("estimated_ages", ("n+1", 3), "s", "-", "-", "the same of the estimates, less the time over which they were carried forward", writer="estimation"),
    Signal("estimated_forces", ("n+1", 3), "N", "-", "world", "external forces on the drones and, last, the load that the controllers know of", writer="observation"),
    Signal("estimated_wind", (3,), "m/s", "-", "world", "velocity of the air that the controllers reckon with", writer="observation"),
    Signal("received_tensions", ("n",), "N", "-", "-", "wanted tensions that have reached the drones", writer="link"),
    Signal("received_directions", ("n", 3), "1", "-", "world", "wanted directions that have reached the drones", writer="link"),
    Signal("received_ages", ("n",), "s", "-", "-", "time since what each drone has received was sent", writer="link"),
    Signal("applied_thrusts", ("n",), "N", "-", "-", "thrusts that act", writer="actuation"),
    Signal("applied_torques", ("n", 3), "N m", "-", "body", "torques that act", writer="actuation"),
    Signal("saturated_times", ("n",), "s", "-", "-", "time in which each drone's motors could not give what was commanded", writer="actuation"),
    Signal("wind", (3,), "m/s", "-", "world", "velocity of the air", writer="disturbance"),
    Signal("carrying", ("n",), "1", "-", "-", "1 for a drone that is taken to carry, 0 once it is judged lost", initial=1.0, writer="detection"),
    Signal("motor_health", ("n", 4), "1", "-", "-", "share of its thrust that each motor still gives", initial=1.0),
    Signal("stuck", ("n+1",), "1", "-", "-", "1 where the sensors of a drone or, last, the load repeat their last value"),
    Signal("allocator_up", (1,), "1", "-", "-", "1 where the allocator answers, 0 where it is silent", initial=1.0),
    Signal("agent_status", ("n",), "1", "-", "-", "status of each drone's own agent", writer="agents"),
    Signal("phase", (1,), "1", "-", "-", "what the supervisor is about; 0 is flying", writer="supervision"),
    Signal("clock", (2,), "s, 1", "-", "-", "time that the reference is given, and how fast it runs: 1 as time does, 0 held", initial=0.0, writer="supervision"),
    Signal("standing", ("n+1",), "1", "-", "-", "1 for each drone and, last, the load that is taken to stand on the ground", writer="supervision"),
    Signal("lift_share", (1,), "1", "s", "-", "share of the wanted tensions that the cables are given", initial=1.0, writer="supervision"),
    Signal("spans", ("n", 3), "m, m/s, m/s^2", "r_i - L_i", "-", "distance that each drone keeps from its cable's end, less the cable's length; two derivatives", writer="supervision"),
    Signal("unhooked", ("n",), "1", "-", "-", "1 for each cable that is told to let go of the load", writer="supervision"),
    Signal("lifted_mass", (1,), "kg", "-", "-", "mass of the load as weighed at lift-off; 0 where nobody weighs it", writer="supervision"),
    Signal("measured_specific_forces", ("n", 3), "m/s^2", "-", "body", "acceleration of each drone less gravity's, as its accelerometer measures it", writer="sensing"),
    Signal("specific_force_ages", ("n",), "s", "-", "-", "time since those samples were taken", writer="sensing"),
    Signal("reeled", ("n", 3), "m, m/s, m/s^2", "-", "-", "cable that each winch has paid out since the start, with two derivatives"),
    Signal("load_attitude", (4,), "1", "q_L", "load to world", "attitude of a rigid load, wxyz", initial=LEVEL, writer="plant_observe"),
    Signal("load_rates", (3,), "rad/s", "Omega_L", "load", "its rates", writer="plant_observe"),
    Signal("reference_attitude", (4,), "1", "q_Ld", "load to world", "wanted attitude of the load, wxyz", initial=LEVEL, writer="reference"),
    Signal("reference_rates", (3, 3), "rad/s, rad/s^2, rad/s^3", "Omega_Ld", "wanted load", "wanted rates of the load and two derivatives", writer="reference"),
    Signal("moment", (3,), "N m", "M_L", "world", "wanted moment of the cables about the load's centre of mass", writer="load_control"),
    Signal("measured_load_attitude", (4,), "1", "-", "load to world", "attitude of the load as measured, wxyz", initial=LEVEL, writer="sensing"),
    Signal("measured_load_rates", (3,), "rad/s", "-", "load", "its rates as measured", writer="sensing"),
    Signal("estimated_load_attitude", (4,), "1", "-", "load to world", "attitude of the load that the controllers use, wxyz", initial=LEVEL, writer="estimation"),
    Signal("estimated_load_rates", (3,), "rad/s", "-", "load", "its rates that the controllers use", writer="estimation"),
    Signal("found_lengths", ("n",), "m", "-", "-", "by how much each cable is found to be longer than is told", writer="observation"),
    Signal("learned_load", (10,), "kg, kg m, kg m^2", "theta", "load", "what is learned of a rigid load beyond what is told: mass, first moment (3), inertia about its place (xx, yy, zz, yz, xz, xy)", writer="load_control"),
    Signal("external_moment", (3,), "N m", "-", "world", "disturbing moment on a rigid load about its centre of mass", writer="disturbance"),
)  # fmt: skip
"""Every recorded signal; one row of the log each recording period."""

CONDITIONS = ("attached", "motor_health", "stuck", "allocator_up")
"""Signals that say what still works; faults change them."""

ANSWER = Signal(
    "allocator_info",
    (7,),
    "-",
    "-",
    "-",
    "what an allocator says of its answer: the middle ones of CYCLE_SIGNALS",
    writer="allocation",
)
"""Not recorded as such."""

NOMINAL = Signal(
    "nominal_forces",
    ("n", 3, 3),
    "N, N/s, N/s^2",
    "T_i alpha_i",
    "world",
    "planned pull of each cable on its drone and two derivatives; not numbers where nothing is planned",
    initial=np.nan,
    writer="reference",
)
"""Not recorded: what follows a plan has it on file."""

LEAD = (
    Signal("reference_shift", (4, 3), "m, m/s, m/s^2, m/s^3", "-", "world", "what the loop adds to the reference", writer="supervision"),
    Signal("courses", ("n", 3, 3), "m, m/s, m/s^2", "-", "world", "where each drone is led, with two derivatives; not numbers while it holds its place in the formation", initial=np.nan, writer="supervision"),
    Signal("held_forces", ("n+1", 3), "N", "-", "world", "forces that observers hold while the load stands: on the drones and, last, what the load pushes beyond the weight that they are told", writer="supervision"),
)  # fmt: skip
"""How a supervisor leads load and drones beside the reference; not recorded."""

ENDS = (
    Signal("ends", ("n", 2, 3), "m, m/s", "-", "world", "places and velocities of the cables' ends on the load", writer="plant_observe"),
    Signal("estimated_ends", ("n", 2, 3), "m, m/s", "-", "world", "those that the controllers use, of the estimated load"),
    Signal("wanted_ends", ("n", 4, 3), "m, m/s, m/s^2, m/s^3", "-", "world", "those of the wanted load, with accelerations and jerks"),
)  # fmt: skip
"""Not recorded, as they follow from the load (:mod:`colift.kernel.load`); the loop writes those without a writer."""

ATTACHMENTS = Signal(
    "attachments",
    ("n", 3),
    "m",
    "rho_i",
    "load",
    "places of the cables' ends on a rigid load, as the controllers are told; zeros on a point",
)
"""Not recorded: the mission says it."""

MESSAGE = 30
"""Length of what a drone broadcasts, bytes: what one packet of a Crazyflie's radio holds."""

MESSAGES = (
    Signal("steady_force", (3,), "N", "-", "world", "part of the wanted force that is not feedback of the moment: planned and learned", writer="load_control"),
    Signal("steady_moment", (3,), "N m", "-", "world", "part of the wanted moment that is learned", writer="load_control"),
    Signal("load_views", ("n", 2, 3), "m, N", "-", "world", "by how much each drone takes the load to be elsewhere than estimated, and to be pushed otherwise", writer="sensing"),
    Signal("viewed_load", (2, 3), "m, m/s", "-", "world", "the load as the drone estimates it whose load controller runs"),
    Signal("viewed_forces", ("n+1", 3), "N", "-", "world", "external forces as that drone knows them"),
    Signal("wishes", ("n", 3), "N", "-", "world", "total force on the load that each drone wants"),
    Signal("steady_wishes", ("n", 3), "N", "-", "world", "the part of each that is not feedback of the moment"),
    Signal("wished_moments", ("n", 3), "N m", "-", "world", "moment on the load that each drone wants"),
    Signal("steady_moments", ("n", 3), "N m", "-", "world", "the part of each that is learned"),
    Signal("plans", ("n", 4, 3), "m, m/s, m/s^2, m/s^3", "x_Ld", "world", "wanted load position and three derivatives, by each drone's clock"),
    Signal("felt_forces", ("n", 3), "N", "-", "world", "force of all cables on the load, as each drone measures it; not numbers where it does not", initial=np.nan),
    Signal("views", ("n", "n"), "1", "-", "-", "1 where a drone takes another to be in the team", writer="agents"),
    Signal("evidences", ("n", "n"), "1", "-", "-", "1 where a drone is told that another carries, or nothing else", initial=1.0),
    Signal("clock_errors", ("n",), "1", "-", "-", "cycles by which each drone's clock is ahead"),
    Signal("members", ("n",), "1", "-", "-", "number in the mission of each drone that flies"),
    Signal("outboxes", ("n", MESSAGE), "-", "-", "-", "message that each drone broadcasts", writer="agents", dtype=np.uint8),
    Signal("inboxes", ("n", "n", MESSAGE), "-", "-", "-", "newest message that each drone has of each", writer="network", dtype=np.uint8),
    Signal("heard", ("n", "n"), "1", "-", "-", "1 where a drone's message of another is new in this cycle", writer="network"),
    Signal("agreed_force", (3,), "N", "-", "world", "steady wanted force to which a load controller is drawn; not numbers where it is alone", initial=np.nan),
    Signal("agreed_forces", ("n", 3), "N", "-", "world", "mean of the steady wishes as each drone knows them", initial=np.nan, writer="agents"),
    Signal("asking", ("n",), "s", "-", "-", "time in which the answer may settle, of each drone that asks the allocator in this cycle", writer="agents"),
    Signal("asked_forces", ("n", 3), "N", "-", "world", "total force for which it asks", writer="agents"),
    Signal("team_tensions", ("n", "n"), "N", "-", "-", "of each drone's picture of the team the tensions: from where the allocator begins, then its answer", writer="agents"),
    Signal("team_directions", ("n", "n", 3), "1", "-", "world", "the same of the directions", writer="agents"),
)  # fmt: skip
"""Of a team without a leader; not recorded."""

WINCHES = Signal(
    "winches",
    ("n", 4),
    "m, m, s, s",
    "-",
    "-",
    "what each winch does (:mod:`colift.kernel.math.winch`)",
)
"""Not recorded: the flight's events write it, and ``reeled`` is what comes of it."""

OTHERWISE = (
    Signal("lean", (9,), "1, rad, s, s", "-", "wanted load", "how a rigid load turns beside its reference (:mod:`colift.kernel.math.leaning`)", initial=(1.0, *[0.0] * 8)),
    Signal("pace", (5,), "s, s, 1, 1, s", "-", "-", "how the pace of the reference's clock changes (:mod:`colift.kernel.math.leaning`)", initial=(0.0, 0.0, 1.0, 1.0, 0.0)),
    Signal("formations", ("n", 2, 3), "1", "-", "wanted heading", "formations that hold a rigid load: cables' forces in hover over its weight, before and after the lean"),
    Signal("formation", ("n", 3), "1", "-", "wanted heading", "the one on the way between them; zeros where nobody plans one"),
    Signal("desired_turning", ("n", 3), "rad/s^2", "-", "body", "angular acceleration of each drone that is planned, so that its torque need not wait for an error", writer="position_control"),
    Signal("clock_bends", (2,), "1/s, 1/s^2", "-", "-", "derivatives of how fast the reference's clock runs", writer="supervision"),
)  # fmt: skip
"""What becomes of the reference when the team has changed, which the flight writes, and what is planned beyond it; not recorded."""

HIDDEN = (ANSWER, NOMINAL, WINCHES, ATTACHMENTS, *LEAD, *ENDS, *MESSAGES, *OTHERWISE)
"""Signals of the bus that stand outside of its row."""

OF_ONE = (
    Signal("wish", (3,), "N", "-", "world", "total force on the load that this drone wants"),
    Signal("steady_wish", (3,), "N", "-", "world", "the part of it that is not feedback of the moment"),
    Signal("wish_moment", (3,), "N m", "-", "world", "moment on the load that this drone wants"),
    Signal("steady_moment", (3,), "N m", "-", "world", "the part of it that is learned"),
    Signal("reference_attitude", (4,), "1", "q_Ld", "load to world", "wanted attitude of the load, wxyz", initial=LEVEL),
    Signal("load_attitude", (4,), "1", "-", "load to world", "its attitude as this drone estimates it, wxyz", initial=LEVEL),
    Signal("formation", ("n", 3), "1", "-", "wanted heading", "cables' forces in hover over the load's weight, as they are planned; zeros where nobody plans them"),
    Signal("number", (1,), "1", "-", "-", "this drone's number in the mission"),
    Signal("members", ("n",), "1", "-", "-", "the numbers of the team, in the order of what has one row a drone"),
    Signal("reference", (4, 3), "m, m/s, m/s^2, m/s^3", "x_Ld", "world", "wanted load position and three derivatives, by this drone's clock"),
    Signal("inbox", ("n", MESSAGE), "-", "-", "-", "newest message of each drone; the own row is not used", dtype=np.uint8),
    Signal("heard", ("n",), "1", "-", "-", "1 for each drone whose message is new"),
    Signal("evidence", ("n",), "1", "-", "-", "1 for each drone that carries, for all that this drone is told; its own is 0 once it has found that it does not itself"),
    Signal("felt", (3,), "N", "-", "world", "force of all cables on the load, as this drone measures it; not numbers where it does not", initial=np.nan),
    Signal("velocity", (3,), "m/s", "-", "world", "of the load, as this drone estimates it; not numbers where it does not", initial=np.nan),
    Signal("tension", (1,), "N", "-", "-", "tension that this drone gives its cable", writer="agents"),
    Signal("direction", (3,), "1", "-", "world", "unit direction to the load that it gives it", writer="agents"),
    Signal("outbox", (MESSAGE,), "-", "-", "-", "message to all others", writer="agents", dtype=np.uint8),
    Signal("inside", ("n",), "1", "-", "-", "1 for each drone that this drone takes to be in the team; an agent that does not judge writes nothing", writer="agents"),
    Signal("asking", (1,), "s", "-", "-", "time in which the answer may settle, where the mission's allocator is to be asked; else 0. It has answered before the next cycle", writer="agents"),
    Signal("agreed", (3,), "N", "-", "world", "mean of the steady wishes: what this drone's load controller has learned is drawn there; not numbers where nothing is agreed", initial=np.nan, writer="agents"),
    Signal("asked_force", (3,), "N", "-", "world", "for which total force", writer="agents"),
    Signal("team_tensions", ("n",), "N", "-", "-", "from which tensions of the team it begins; then its answer", writer="agents"),
    Signal("team_directions", ("n", 3), "1", "-", "world", "the same of the directions", writer="agents"),
)  # fmt: skip
"""What one drone's agent sees and writes: rows of signals of the bus (:mod:`colift.flight.agents`)."""

CYCLE_SIGNALS = tuple(
    replace(signal, each="allocation")
    for signal in (
        Signal("allocator_status", (), "1", "-", "-", "status code of each allocation"),
        Signal("allocator_iterations", (), "1", "-", "-", "iterations of each allocation"),
        Signal("allocator_kkt_residual", (), "1", "-", "-", "optimality residual of each allocation"),
        Signal("allocator_objective", (), "N^2", "J", "-", "objective of each allocation"),
        Signal("allocator_optimality_gap", (), "N^2", "-", "-", "objective less the global optimum"),
        Signal("allocator_force_residual", (), "N", "-", "-", "error of the force balance"),
        Signal("allocator_active_limits", (), "1", "-", "-", "bits of the limits at work; 0 without limits"),
        Signal("allocator_moment_residual", (), "N m", "-", "-", "error of the balance of moments about a rigid load's centre of mass"),
        Signal("allocator_time", (), "s", "-", "-", "measured duration of each allocation"),
    )
)  # fmt: skip
"""Recorded once per allocation, in this order."""

LEGEND = {signal.name: signal for signal in (*SIGNALS, *CYCLE_SIGNALS)}
"""All that are recorded, by name."""


Bus = named_tuple("Bus", ["row", *(signal.name for signal in (*HIDDEN, *SIGNALS))], __name__)
"""The bus row, the signals that stand outside of it, and its views, one per recorded signal."""


def columns(n: int) -> dict[str, slice]:
    """Where each signal stands in the bus row."""
    where, start = {}, 0
    for signal in SIGNALS:
        size = int(np.prod(signal.shape_for(n)))
        where[signal.name] = slice(start, start + size)
        start += size
    return where


def make_bus(n: int) -> Any:
    """A bus for n drones, every signal at its initial value."""
    where = columns(n)
    row = np.zeros(max(part.stop for part in where.values()))
    views = {s.name: row[where[s.name]].reshape(s.shape_for(n)) for s in SIGNALS}
    views |= {s.name: np.empty(s.shape_for(n), s.dtype) for s in HIDDEN}
    for s in (*HIDDEN, *SIGNALS):
        views[s.name][:] = s.initial
    return Bus(row=row, **views)
