"""How near the loops of attitude, position and load are to instability: a linear model of each, with delay, hold, lag and filters.

The modulus margin of a loop is the least distance of its open-loop response from -1, ``min |1 + L| = 1 / max |S|``: a gain
that is off by a factor from ``1 / (1 + margin)`` to ``1 / (1 - margin)``, or a phase by ``2 asin(margin / 2)``, is borne. Delays are
exact; what is held over a period is answered in the attitude's loop as it is sampled, in the slower ones as a continuous loop with the
hold's response.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Response = NDArray[Any]
"""Complex numbers, one for each frequency."""
Array = NDArray[np.float64]

POINTS = 320
SLOWEST = 2e-3
"""Lowest frequency that is looked at, rad/s."""
LEAK = 5e-3
"""Rate at which integrators are let to forget, rad/s: so that the model has no pole at zero."""
REFERENCE = 1.0
"""Poles of the stable polynomial beside which zeros are counted, rad/s."""
EASED = 0.65
"""Share of the gain of the cables' lean that counts where three or more carry the load: an allocator turns them at a bounded rate, so that
what grows with a little too much gain stays small."""
STILL = 0.2
"""Share of the rate at which the observed force is followed below which the model is not asked."""
BETWEEN = 0.75
"""Zeros counted from which a loop is unstable: half a one stands for a mode that is neither."""


class Turning(NamedTuple):
    """``tau = -K (Omega + rho q_e)`` about one axis."""

    gain: float
    """K, N m s."""
    slope: float
    """rho, 1/s."""
    inertia: float
    """kg m^2, the true one."""


class Timing(NamedTuple):
    """What stands between a motion and the answer to it, s."""

    attitude: float
    """Age of the measured attitudes, and of the rates."""
    rates: float
    tracking: float
    """Of the drones' places, and of the load's."""
    load: float
    lag: float
    """Of the motors."""
    turned: float
    """Period of attitude control, and of position control."""
    placed: float
    told_delay: float = 0.0
    """What the law of the attitude predicts away, and the lag that it inverts."""
    told_lag: float = 0.0
    leaning: float | None = 0.0
    """Time constant with which the allocator turns the cables with the force; None where nobody knows, and they are taken to stay."""
    told_turn: float = 0.0
    """Delay over which the axis of the known thrust is carried forward."""


class Places(NamedTuple):
    """Position control per mass of a drone: ``a = -damping v_e - stiffness x_e - integral int x_e``."""

    damping: float
    """1/s."""
    stiffness: float
    """1/s^2."""
    integral: float = 0.0
    """1/s^3."""
    lead: float = math.inf
    """Frequency of the filter of the wanted cable directions, rad/s; inf where they are taken as they are."""
    rate_filter: float = math.nan
    """Time constant of the derivative of unfiltered directions, s; NaN where they are filtered or have no rate."""
    thrust_filter: float = 0.0
    """Time constant of the derivative of the thrust direction, s."""
    observer: float = 0.0
    """Bandwidth of an observer of each drone's own force in the law itself, 1/s."""
    swing: tuple[float, float] = (0.0, 0.0)
    """Gains of speed and place of the load, 1/s and 1/s^2."""
    follows: bool = False
    """Whether forces of the layer of observation are made up for, and the cable's pull is taken along the measured cable."""


class Hanging(NamedTuple):
    """Load control: ``u = -place e - speed e' - integral int e``, or the filtered force of the observers."""

    place: float = 0.0
    """N/m."""
    speed: float = 0.0
    """N s/m."""
    integral: float = 0.0
    """N/(m s)."""
    rate: float = 0.0
    """How fast the observed force is followed, 1/s."""


class Filter(NamedTuple):
    """A steady Kalman filter of place, speed and unexplained acceleration, carried forward over the delay."""

    gain: Array
    """(3, 2), 1/s times what a sample corrects."""
    known: bool
    """Whether the commanded acceleration is known to it."""


class Bodies(NamedTuple):
    """The team about its formation, in a plane: drones move by ``y`` together and turn by ``phi`` about the load."""

    drones: float
    """Mass of all, kg."""
    load: float
    weight: float
    """Of the load, N."""
    height: float
    """Of the drones above the load, m."""
    turning: float
    """Moment of inertia of the drones' heights, kg m^2; 0 where none resists the load's swing."""
    number: int


def times(factor: Response | float, row: Response) -> Response:
    """A row of coefficients (k, m), each times a response (k,)."""
    return np.asarray(np.reshape(factor, (-1, 1)) * row)


@dataclass(frozen=True)
class Margin:
    """Of one loop.

    Attributes
    ----------
    modulus : float
        ``min |1 + L|``; 0 where the loop is unstable.
    frequency : float
        Where that is, rad/s.
    stable : bool

    """

    modulus: float
    frequency: float
    stable: bool


def frequencies(fastest: float) -> Array:
    """Up to the fastest, rad/s."""
    return np.geomspace(SLOWEST, fastest, POINTS)


def unstable_zeros(response: Response) -> float:
    """Of a response that has no poles outside and is real at both ends: how many zeros it has where there must be none."""
    turned = np.unwrap(np.angle(response))
    return -float(turned[-1] - turned[0]) / math.pi


def margin_of(
    w: Array, sensitivity_inverse: Response, zeros: float, slowest: float = 0.0
) -> Margin:
    """Of ``1 + L``, whose zeros where there must be none were counted; looked at from the frequency ``slowest`` on."""
    size = np.where(w < slowest, math.inf, np.abs(sensitivity_inverse))
    k = int(np.argmin(size))
    stable = zeros < BETWEEN
    return Margin(float(size[k]) if stable else 0.0, float(w[k]), stable)


def turn_loop(w: Array, law: Turning, time: Timing) -> tuple[Margin, Response, Response]:
    """The attitude's loop, sampled exactly: its margin at the rotors, then the answer to a wanted angle and to a wanted rate."""
    t, J = time.turned, law.inertia
    s = 1j * w
    z = np.exp(s * t)
    back = 1.0 / z
    a = math.exp(-t / time.lag) if time.lag > 0.0 else 0.0
    rest = time.lag * (1.0 - a)
    rest2 = time.lag * (t - rest)
    torque = (1.0 - a) / (z - a)
    rate = (rest / J * torque + (t - rest) / J) / (z - 1.0)
    angle = (t * rate + rest2 / J * torque + (0.5 * t * t - rest2) / J) / (z - 1.0)
    # The motors' lag is inverted, the torques since the measurement are known.
    keep = math.exp(-t / time.told_lag) if time.told_lag > 0.0 else 0.0
    command = (1.0 - keep * back) / (1.0 - keep)
    linger = (1.0 - keep) * time.told_lag / t
    acted = (1.0 - linger) * command + linger * back
    d = time.told_delay
    whole = int(d / t + 1e-9)
    spans = np.full(whole + 1, t)
    spans[-1] = d - whole * t
    after = t * np.arange(whole + 1)
    past = back[:, None] ** np.arange(1, whole + 2)
    known_rate = past @ (spans / J) * acted
    known_angle = past @ (spans * (0.5 * spans + after) / J) * acted
    half = 0.5 * law.slope
    inner = law.gain * (known_rate + half * known_angle)
    late, late_rate = np.exp(-s * time.attitude), np.exp(-s * time.rates)
    outer = law.gain * (rate * late_rate * (1.0 + half * d) + half * angle * late) * command
    whole_loop = 1.0 + inner + outer
    stable = 1.0 / (1.0 + t * REFERENCE)
    zeros = unstable_zeros(whole_loop * ((z - 1.0) / (z - stable)) ** 2)
    answer = law.gain * command * angle / whole_loop
    return margin_of(w, whole_loop / (1.0 + inner), zeros), half * answer, answer


class Seen(NamedTuple):
    """What is estimated of a place: of itself and of the known acceleration, then the same of the speed."""

    place: Response
    place_known: Response
    speed: Response
    speed_known: Response


def seen(w: Array, delay: float, kalman: Filter | None) -> Seen:
    """An estimate from measurements of this age."""
    s = 1j * w
    late, none = np.exp(-s * delay), np.zeros(w.size, dtype=complex)
    if kalman is None:
        return Seen(late, none, s * late, none)
    k = kalman.gain
    A = np.zeros((w.size, 3, 3), dtype=complex)
    A[:] = -np.eye(3, k=1)
    A[:, :, :2] += k
    A[:, [0, 1, 2], [0, 1, 2]] += s[:, None]
    b = np.zeros((w.size, 3, 2), dtype=complex)
    b[:, :, 0] = k[:, 0] + s[:, None] * k[:, 1]
    b[:, 1, 1] = 1.0 if kalman.known else 0.0
    x = np.linalg.solve(A, b) * late[:, None, None]
    d = delay
    place = x[:, 0] + d * x[:, 1] + 0.5 * d * d * x[:, 2]
    speed = x[:, 1] + d * x[:, 2]
    if kalman.known:
        place[:, 1] += (1.0 - late * (1.0 + s * d)) / s**2
        speed[:, 1] += (1.0 - late) / s
    return Seen(place[:, 0], place[:, 1], speed[:, 0], speed[:, 1])


def _low_pass(s: Response, rate: float) -> Response | float:
    return rate / (s + rate) if rate > 0.0 else 0.0


@dataclass
class Loops:
    """The loops of position and load about those of the attitude.

    Attributes
    ----------
    w : (k,) array
        Frequencies, rad/s.
    tilt, spin : (k,) array
        Answers of the thrust's direction to a wanted one, and to its wanted rate.

    """

    w: Array
    tilt: Response
    spin: Response
    time: Timing
    places: Places
    hanging: Hanging
    observers: tuple[float, float]
    drones: Seen
    load: Seen

    def __post_init__(self) -> None:
        s = self.s = 1j * self.w
        t, h = self.time, self.time.placed
        keep = math.exp(-h / self.places.thrust_filter) if self.places.thrust_filter > 0.0 else 0.0
        back = np.exp(-s * h)
        rate = (1.0 - keep) * (1.0 - back) / h / (1.0 - keep * back)
        slower = np.exp(-0.5 * s * max(h - t.turned, 0.0))
        self.aim: Response = (self.tilt + self.spin * rate) * slower
        self.axis: Response = np.exp(-s * t.attitude) + t.told_turn * s * np.exp(-s * t.rates)
        hold = (1.0 - back) / (s * h)
        self.lift: Response = hold / (1.0 + s * t.lag)
        law = self.places
        self.pull = law.stiffness + law.integral / (s + LEAK)

    def alone(self, number: int) -> Margin:
        """One drone whose load stands still, by how many there are."""
        s, seen, law = self.s, self.drones, self.places
        place = seen.place / s**2 + seen.place_known * self.axis
        speed = seen.speed / s**2 + seen.speed_known * self.axis
        asked = law.damping * speed + self.pull * place
        felt = s * speed - self.axis  # beyond what is known, over the force
        asked = asked + _low_pass(s, law.observer) * felt
        if law.follows:
            total, own = (_low_pass(s, rate) for rate in self.observers)
            asked = asked + (own + (total - own) / number) * felt
        whole = 1.0 + self.aim * asked
        zeros = unstable_zeros(whole * (s / (s + REFERENCE)) ** 2)
        return margin_of(self.w, whole, zeros)

    def _commands(
        self, bodies: Bodies, y: Response, phi: Response, F: Response, lean: Response
    ) -> tuple[Response, Response, Response]:
        """Force and moment that are asked of the drones, and the lean that is asked of the cables, as rows of the unknowns (k, 5)."""
        s, law, k = self.s, self.places, self.w.size
        M, m_L, W, h, I, _ = bodies  # noqa: E741
        bent = W * I / (M * h)  # what the drones' outward forces resist a turn with, N m
        axis = times(self.axis, F)
        acceleration = (axis - W * lean) / M
        place = times(self.drones.place, y) + times(self.drones.place_known, acceleration)
        speed = times(self.drones.speed, y) + times(self.drones.speed_known, acceleration)
        hung = y - h * phi
        load_place, load_speed = times(self.load.place, hung), times(self.load.speed, hung)
        led, led_rate = np.ones(k, dtype=complex), s.copy()
        if math.isfinite(law.lead):
            led = (law.lead / (s + law.lead)) ** 2
            led_rate = s * led
        elif math.isnan(law.rate_filter):
            led_rate = np.zeros(k, dtype=complex)
        else:
            led_rate = s / (1.0 + law.rate_filter * s)
        fed = s * led_rate if math.isfinite(law.lead) else np.zeros(k, dtype=complex)
        u = times(M * fed * h, lean) - M * law.damping * (speed - times(h * led_rate, lean))
        u = u - times(M * self.pull, place - times(h * led, lean))
        late = np.exp(-s * self.time.tracking) if not np.any(self.drones.place_known) else 1.0
        turned, turned_rate = times(late, phi), times(late * s, phi)
        moment = times(I * fed, lean) - I * law.damping * (turned_rate - times(led_rate, lean))
        moment = moment - times(I * self.pull, turned - times(led, lean)) + times(bent * led, lean)
        drones = M * times(s, speed) - axis
        known = drones + m_L * times(s, load_speed)
        pulled = drones + W * turned
        if law.follows:
            whole, each = (np.reshape(_low_pass(s, rate), (-1, 1)) for rate in self.observers)
            of_all, of_each = whole * known, each * pulled
            u = u - of_all
            if bodies.number <= 2:
                fast, far = law.swing
                u = u - M * (fast * load_speed + far * load_place)
                u = u + W * (turned - times(led, lean))
                moment = 0.0 * moment
            back = np.exp(-s * self.time.placed)
            asked = -times(_low_pass(s, self.hanging.rate) * back / W, of_all - of_each)
        else:
            u = u + times(W * led, lean)
            if law.observer > 0.0:
                felt = drones + times(W * led, lean)
                u = u - times(_low_pass(s, law.observer), felt)
            gain = self.hanging.place + self.hanging.integral / (s + LEAK)
            asked = -(times(gain, load_place) + self.hanging.speed * load_speed) / W
        if bodies.number > 2:
            asked = EASED * asked
        return u, moment, asked

    def together(self, bodies: Bodies) -> tuple[Margin, Margin]:
        """All drones and the load: the loop at the drones' force, and that at the wanted lean of the cables."""
        s, k = self.s, self.w.size
        M, m_L, W, h, I, _ = bodies  # noqa: E741
        bent = W * I / (M * h)  # what the drones' outward forces resist a turn with, N m
        y, phi, F, N, lean = (np.zeros((k, 5), dtype=complex) for _ in range(5))
        for i, unit in enumerate((y, phi, F, N, lean)):
            unit[:, i] = 1.0
        u, moment, asked = self._commands(bodies, y, phi, F, lean)
        rows = np.empty((k, 5, 5), dtype=complex)
        s2 = s**2
        rows[:, 0] = times((M + m_L) * s2, y) - times(m_L * h * s2, phi) - F
        rows[:, 1] = times((I + m_L * h * h) * s2 + W * h + bent, phi) - times(h * m_L * s2, y) - N
        rows[:, 2] = F - times(self.aim, u)
        rows[:, 3] = N - times(self.lift, moment)
        slow_lean = self.time.leaning
        rows[:, 4] = lean if slow_lean is None else lean - times(1.0 / (1.0 + s * slow_lean), asked)
        whole_loop = np.linalg.det(rows)
        # A lean that is taken for a push on the load leans on: slow by nature, and bounded by the drones' places.
        slowest = self.hanging.rate
        count = self.w >= STILL * slowest
        beside = (s + REFERENCE) ** 4
        zeros = unstable_zeros((whole_loop / beside)[count])
        without = rows.copy()
        without[:, 2] = F
        at_force = whole_loop / np.linalg.det(without)
        without[:, 2], without[:, 4] = rows[:, 2], lean
        open_load = np.linalg.det(without)
        alone = unstable_zeros((open_load / beside)[count])
        at_lean = whole_loop / open_load
        slow = STILL * slowest
        return margin_of(self.w, at_force, alone, slow), margin_of(self.w, at_lean, zeros, slowest)
