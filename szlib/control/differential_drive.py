"""A differential drive: a point ahead of the axle is driven, and the wheels follow it exactly.

The robot is a disc of radius r about the middle c of its axle, heading theta. It holds a commanded speed v
and turning rate omega for dt. `MPCCBF` drives the point

    p = c + L e(theta),     e = (cos theta, sin theta),     L = `ahead`

as a double integrator. This is possible because p moves sideways as the robot turns. The disc lies within
r + L of p.

*At the samples p is where the plan says.* Let the plan move p by xi ahead and eta to the left within dt, and
let the robot turn by 2 beta = omega dt. Seen at the heading theta + beta, half way, c moves straight ahead by
v dt sin(beta)/beta, and L e by 2 L sin(beta) to the left. Together they are to be (xi, eta):

    2 L sin(beta)           = eta cos(beta) - xi sin(beta),     so  tan(beta) = eta / (2 L + xi)
    v dt sin(beta) / beta   = xi cos(beta) + eta sin(beta)

So p, with the velocity that was planned for it, is a double integrator without any error, and what
`szlib.control.mpc` proves holds: h >= 0 at p after every step that satisfied the problem.

*Limits.* Let p be no faster than V, so D = |(xi, eta)| <= V dt. By the first line 2 L sin|beta| <= D, hence
|omega| <= omega_max where

    V = min(v_max, 2 L sin(omega_max dt / 2) / dt),     omega_max dt < pi

By both lines (v dt)^2 = (D^2 - 4 L^2 sin^2 beta) beta^2 / sin^2 beta <= D^2, for beta <= tan beta: |v| <= V.

*Between samples* p runs along an arc that turns by 2 beta, and leaves its chord by at most

    chord_error = V dt / 2 * tan(beta_max / 2),     sin(beta_max) = V dt / 2 L           (5 mm by default)

*From p to the disc.* The point keeps r' = r + eps + L + chord_error. People, and walls with
`margin="euclidean"`: the distance changes by no more than the way, so h >= 0 at p is h >= 0 at c. Else the
point has the margin r'^2 / l to a wall of length l. Write the paper's distance to it as d = s + s^2 / l.
With t its trimming term, 0 <= t <= d, |grad d|^2 = 1 + 4 t / l, and ds/dd is (1 + 4 d / l)^(-1/2): s changes
by no more than the way either. h >= 0 at p says s >= r' there, so s >= r + eps at c, which is h >= 0. So
*the disc has h >= 0 after every step that said it was safe*, where people do as predicted. In between,
the chord of p, seen by a person at the relative speed u, cuts at most (u dt)^2 / 8 r' off their zone (4 mm
at 1.5 m/s), as it does for any robot: eps is for that.

*Not modelled*: wheels that need time to reach (v, omega). The plan bounds how p accelerates; the wheels
follow with dv/dt = (acceleration of p along e) + L omega^2, so by up to V^2 / L more.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import asin, atan2, cos, dist, hypot, inf, pi, remainder, sin, tan
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..core.checks import Array, check_array, check_number, check_vector
from ..zones.ellipses import Ellipse
from .mpc import MPCCBF
from .obstacles import Path, Point
from .people import SpeedZone
from .settings import MPCSettings, check_argument
from .step import Scene, Step
from .verification import PIECES, Sampled
from .ways import Heading

_NEAR = 3.0  # distance of the goal, as a multiple of `ahead`, at which a turn on the spot may begin
# turns that are tried, in this order [rad]
_TURNS = np.array(sorted(np.linspace(-pi, pi, 33), key=abs))
# largest turn that is asked for at once, and where a turn ends [rad]
_TURN = 1.0
_ALIGNED = 0.2
_FREE = 0.02  # h that the point needs [m]


@dataclass(frozen=True)
class Unicycle:
    """How a differential drive moves: state (x, y, theta, v, omega), driven by (v, omega).

    Parameters
    ----------
    heading : of a robot that starts at rest [rad]; a moving robot heads in its direction of motion.

    Examples
    --------
    >>> import numpy as np
    >>> from szlib.control import Unicycle
    >>> own = Unicycle().start((0.0, 0.0, 1.0, 0.0))
    >>> Unicycle().advance(own, np.array([1.0, 0.0]), dt=0.1)[:2].round(3).tolist()
    [0.1, 0.0]
    """

    heading: float = 0.0
    inputs = ("v", "omega")

    def start(self, state: ArrayLike) -> Array:
        """The robot's own state, shape (5,), from `state`, (x, y, vx, vy) of its centre."""
        x, y, vx, vy = check_vector("state", state, 4)
        heading = atan2(vy, vx) if vx or vy else self.heading
        return np.array([x, y, heading, hypot(vx, vy), 0.0])

    def body(self, own: Array) -> Array:
        """(x, y, vx, vy) of the disc's centre, from the robot's state `own`."""
        x, y, theta, v, _ = own.tolist()
        return np.array([x, y, v * cos(theta), v * sin(theta)])

    def advance(self, own: Array, control: Array, dt: float) -> Array:
        """The state after `own` when `control`, (v, omega), was held for `dt` [s]: exact, along an arc."""
        (x, y, theta, *_), (v, omega) = own.tolist(), control.tolist()
        half = omega * dt / 2
        move = rect(v * dt * np.sinc(half / pi), theta + half)
        x = x + move.real
        y = y + move.imag
        return np.array(
            [
                x,
                y,
                (theta + 2 * half + pi) % (2 * pi) - pi,
                v,
                omega,
            ]
        )


@dataclass(frozen=True)
class _Wheels:
    """The commands that bring the point ahead of the axle from place to place.

    Attributes
    ----------
    ahead : distance of the point from the axle [m].
    v_max : its greatest speed [m/s].
    """

    ahead: float
    v_max: float
    robot: Unicycle = Unicycle()

    def follow(
        self, own: Array, points: Array, times: ArrayLike
    ) -> tuple[Array, Array]:
        """States of the disc, shape (k+1, 4), and commands, shape (k, 2).

        Parameters
        ----------
        own : state of the robot, (x, y, theta, v, omega).
        points : where the point is now, and is to be, one after the other, shape (k+1, 2) [m].
        times : when it is to be there, shape (k+1,) [s].
        """
        at = own
        states = [self.robot.body(own)]
        controls = []
        lasts = np.diff(times).tolist()
        for (px, py), dt in zip(points[1:].tolist(), lasts, strict=True):
            x, y, theta, *_ = at.tolist()
            away = complex(px - x, py - y) - rect(self.ahead, theta)
            share = min(1.0, self.v_max * dt / (abs(away) or 1.0))
            # xi + i eta
            move = share * (away * rect(1.0, -theta))
            beta = phase(2 * self.ahead + move)
            way = (move * rect(1.0, -beta)).real / np.sinc(beta / pi)
            controls.append(np.array([way / dt, 2 * beta / dt]))
            at = self.robot.advance(at, controls[-1], dt)
            states.append(self.robot.body(at))
        return np.array(states), np.reshape(controls, (-1, 2))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class DriveStep(Step):
    """What a differential drive does next, and how far it can be relied upon: a `Step`.

    The plan, `inputs`, and what is said of its rows are about the point ahead of the axle, the rest is about
    the disc.

    Attributes
    ----------
    control : (v, omega) to hold for the next dt, within their limits, shape (2,) [m/s, rad/s].
    own : state of the robot now, (x, y, theta, v, omega).
    wheels : how they follow the point.

    As of a `Step` are `status`, `walls_safe`, `passively_safe`, `target`, `solve_time`, `timed_out`, `scene`,
    `of_point`, `way_length`, `ways`, `stuck` and `clock`.
    """

    own: Array
    wheels: _Wheels
    _units: ClassVar[str] = "({:.3g} m/s, {:.3g} rad/s)"

    @cached_property
    def predicted(self) -> Array:
        """(x, y, vx, vy) of the disc's centre now and along the plan, shape (N+1, 4) [m, m/s]."""
        states, _ = self.wheels.follow(
            self.own, self.planned[:, :2], self.asked.settings.times
        )
        return states

    @property
    def _sideways(self) -> float:
        return float(abs(self.control.prod()))

    def carry(self, way: Sampled) -> Sampled:
        """The `way` of the disc, whose wheels follow the point."""
        wheels = self.wheels
        _, commands = wheels.follow(self.own, way.points[::PIECES], way.times[::PIECES])
        commands[0] = self.control
        held = zip(np.repeat(commands, PIECES, axis=0), np.diff(way.times), strict=True)
        found = [self.own]
        for control, dt in held:
            found.append(wheels.robot.advance(found[-1], control, dt))
        return way._replace(points=np.array(found)[:, :2])


class DifferentialDrive(MPCCBF):
    """Drives a robot with two wheels to a goal, outside the social zones of people and away from walls.

    The disc's centre comes to within 7 cm of a goal, at any heading, if v_max is 1.5 m/s or less, and the
    goal is r_robot + 2 `ahead` and some cm from walls and zones of people who stand. At a closer goal the
    robot turns its back to the obstacle and goes backwards; it needs about r_robot + `ahead` there, else it
    moves about near the goal. A robot that starts in front of a wall nearer than `ahead`, where its point is
    in or beyond the wall, may stay there: turn it first.

    The `state` that `step` takes is (x, y, theta) of the axle's middle [m, rad], or (x, y, theta, v, omega)
    [m, rad, m/s, rad/s]. The plan begins at the planned velocity of the point. If the robot was stopped or
    pushed, and (v, omega) differs from the last command by more than a_max dt, it begins at (v, omega), but
    no faster than the wheels. With a `state_age` above 0 this is not noticed: call `reset` after a stop. The
    `goal` is that of the disc's centre. The step is a `DriveStep`, whose `control` is (v, omega), to be held
    for the next dt.

    Parameters
    ----------
    zone : as of `MPCCBF`.
    given : walls, obstacles and tracker, as of `MPCCBF`, and `settings` of the robot: `r_robot` its
        radius about the middle of the axle, `v_max` the limit of |v|; `a_max` bounds the
        acceleration of the point ahead of the axle. An attribute as well.
    omega_max : limit of |omega| [rad/s]; default: that of a common indoor robot whose wheels reach 1 m/s
        (assumed).
    ahead : distance of the point from the axle [m]; default: the smallest one with which `settings.v_max` can
        be reached, about v_max / omega_max. With less the robot is slower, with more it needs more space: it
        fits where a double integrator of the radius r_robot + ahead fits.

    Attributes
    ----------
    robot : how it moves: a `Unicycle`.
    v_max : speed that it can reach [m/s]; see `ahead`.
    chord_error : largest distance of the point from the straight line between two samples [m].

    Raises
    ------
    SolverError : a limit cannot be used, or as of `MPCCBF`.

    Examples
    --------
    >>> import szlib
    >>> zone = szlib.Ellipse(center=(0.1, 0.0), semi_axes=(1.0, 0.7))
    >>> drive = szlib.DifferentialDrive(zone, settings=szlib.MPCSettings(r_robot=0.3), omega_max=4.0)
    >>> step = drive.step((-4.0, 0.0, 0.0), goal=(4.0, 0.0), people=[szlib.Person((0.0, 0.2), (-0.5, 0.0))])
    >>> v, omega = step.control  # [m/s, rad/s]
    >>> step.safe
    True
    """

    robot: Unicycle = Unicycle()

    def __init__(
        self,
        zone: Ellipse | SpeedZone,
        *,
        omega_max: float = 4.0,
        ahead: float | None = None,
        **given: Any,
    ) -> None:
        self.omega_max = check_number("omega_max", omega_max)
        self.ahead = inf if ahead is None else check_number("ahead", ahead)
        super().__init__(zone, **given)

    def _plan_with(self, s: MPCSettings) -> MPCSettings:
        """Settings of the point ahead of the axle."""
        turned = self.omega_max * s.dt
        ahead = self.ahead
        expected = f"in (0, pi/dt) = (0, {pi / s.dt:g})"
        check_argument(0 < turned < pi, "omega_max", self.omega_max, expected)
        expected = "positive, because the axle itself cannot move sideways"
        check_argument(ahead > 0, "ahead", ahead, expected)
        turn = 2 * sin(turned / 2) / s.dt
        if self.ahead == inf:
            self.ahead = s.v_max / turn
        self.v_max = min(s.v_max, self.ahead * turn)
        way = self.v_max * s.dt
        self.chord_error = way / 2 * tan(asin(way / 2 / self.ahead) / 2)
        radius = s.r_robot + (s.eps + self.ahead + self.chord_error)
        self._wheels = _Wheels(self.ahead, self.v_max)
        if s.margin == "paper":
            s = replace(s, margin="required")
        return replace(s, r_robot=radius, eps=0.0, v_max=self.v_max)

    def reset(self) -> None:
        """Forget the last plan and command, and all people."""
        super().reset()
        self._command = np.full(2, np.nan)
        self._turns = False
        self._seen: Scene | None = None
        self._planned_velocity = np.zeros(2)

    def _locate(
        self, state: ArrayLike, goal: Point, age: float
    ) -> tuple[list[float], Point]:
        """State and goal of the point, from those of the axle's middle."""
        old = check_array("state", state, (...,))
        expected = "(x, y, theta) or (x, y, theta, v, omega) of the axle's middle"
        check_argument(old.shape in ((3,), (5,)), "state", state, expected)
        if len(old) == 3:
            old = np.append(old, np.nan_to_num(self._command))
        self._goal = goal
        self._own = own = self._clock.bring_forward(self.robot, old, age, old[3:])
        x, y, theta, v, omega = own.tolist()
        turn = self._find_turn((x, y, theta), goal)
        # of the axle: it turns where it stands, or drives to the goal
        gx, gy = (x, y) if turn else goal
        here = rect(self.ahead, theta)
        there = rect(self.ahead, theta + turn)
        velocity = self._planned_velocity.tolist()
        deviation = hypot(*((own[3:] - self._command) * (1.0, self.ahead)))
        # the robot was stopped or pushed, or begins
        if not deviation <= self.settings.a_max * self.settings.dt:
            true = rect(1.0, theta) * complex(v, self.ahead * omega)
            true *= self.v_max / max(self.v_max, abs(true))  # as fast as the wheels
            velocity = [true.real, true.imag]
        goal = gx + there.real, gy + there.imag
        return [x + here.real, y + here.imag, *velocity], goal

    def _finish(self, **found: Any) -> DriveStep:
        """The command with which the wheels follow the point."""
        point = Step(**found)
        asked = self._seen = point.scene
        planned = point.planned[:2]
        _, (control,) = self._wheels.follow(
            self._own, planned[:, :2], self._s.times[:2]
        )
        self._command = control.copy()
        self._planned_velocity = planned[1, 2:]
        found["scene"] = self._make_scene(
            self.robot.body(self._own), self._goal, asked.tracked
        )
        found |= {"control": control, "of_point": asked}
        return DriveStep(**found, own=self._own, wheels=self._wheels)

    def _find_headings(self, scene: Scene) -> Sequence[Heading]:
        """As of `MPCCBF`, but straight to a goal so close that no wall lies between, as in a turn."""
        away = dist(scene.state[:2], scene.goal)
        if away < self._s.r_robot and not scene.tracked.unknown:
            return [Heading(scene.goal, away)]
        return super()._find_headings(scene)

    def _carry(self, path: Path) -> Path:
        """The way of the disc whose wheels follow the point on a `path`."""
        centres, commands = self._wheels.follow(self._own, path.points, path.times)
        bows = np.abs(commands.prod(axis=1)) * np.diff(path.times) ** 2 / 8
        return Path(centres[:, :2], path.times, bows)

    def _find_turn(self, own: tuple[float, ...], goal: Point) -> float:
        """Angle by which the robot turns where it stands, close to its `goal` [rad]; 0: it drives on.

        It turns if the point ahead could not be where it is to be when the disc is at the goal, because of a
        wall or a person who stands. It turns its back to the goal, or as far as the point could be there
        then, and goes backwards.
        """
        x, y, theta = own
        gx, gy = goal
        scene = self._seen
        reach = (1.5 if self._turns else 1.0) * _NEAR * self.ahead
        if scene is None or hypot(gx - x, gy - y) > reach:
            self._turns = False
            return 0.0
        headings = np.array([theta, *(atan2(y - gy, x - gx) + _TURNS)])
        px = gx + self.ahead * np.cos(headings)
        py = gy + self.ahead * np.sin(headings)
        h = scene.find_standing_h(px, py)
        free = h.min(axis=0, initial=inf) >= _FREE
        turn = remainder(float(headings[1:][free[1:].argmax()]) - theta, 2 * pi)
        self._turns = bool(free[1:].any()) and (
            abs(turn) > _ALIGNED if self._turns else not free[0]
        )
        return max(-_TURN, min(turn, _TURN)) if self._turns else 0.0
