"""szlib's worlds as a Gymnasium environment: `pip install gymnasium`, then `python gymnasium_env.py`.

action       (ax, ay) of the robot, each within `settings.a_max` [m/s2], held for `settings.dt`
observation  (vx, vy) and, relative to the robot's position, the goal; then the `PEOPLE` nearest people, each
             (x, y, vx, vy, h), and the `WALLS` walls of smallest h, each (xa, ya, xb, yb, h). h is the value of the
             barrier [m]: negative inside of a social zone, or too close to a wall. Missing rows are `FAR`; numbers
             are clipped to `FAR`.
reward       progress to the goal [m] - 10 max(0, -min h) [m] - max(0, speed - `settings.v_max`) [m/s]
terminated   when the robot rests at the goal; truncated at the time limit of the scenario

The robot, people and barriers are those of szlib: a controller has the same run here as in `szlib.simulate`.
"""

from collections.abc import Callable
from dataclasses import replace
from math import hypot

import gymnasium
import numpy as np

import szlib
from szlib.control.controller import DoubleIntegrator
from szlib.control.people import as_ellipse
from szlib.simulation.crowds import UNAFFECTED, CrowdModel
from szlib.simulation.scenario import GOAL_RADIUS, STOPPED_SPEED

PEOPLE, WALLS, FAR = 5, 4, 50.0  # rows of each, and the largest number of an observation


class SocialEnv(gymnasium.Env):
    """A robot among people.

    Parameters
    ----------
    scenarios : makes a scenario from a seed, such as `szlib.Worlds()`.
    zone : the zone of people who have none of their own.
    settings : dt, a_max, v_max, r_robot, eps and zone_speed are used.
    behaviour : how people move, such as `szlib.simulation.ReactingPeople("orca")`; they are observed without noise.
    """

    def __init__(
        self,
        scenarios: Callable[[int], szlib.Scenario] | None = None,
        zone: szlib.Ellipse | szlib.SocialZone | None = None,
        settings: szlib.MPCSettings | None = None,
        behaviour: CrowdModel = UNAFFECTED,
    ):
        self.settings, self.behaviour = settings or szlib.MPCSettings(), behaviour
        self.scenarios, self.robot = scenarios or szlib.Worlds(), DoubleIntegrator()
        zone = zone or szlib.reference_zone("grand-central-strangers").ellipse
        self.zone = as_ellipse(zone, self.settings.zone_speed)
        a_max, size = self.settings.a_max, 4 + 5 * (PEOPLE + WALLS)
        self.action_space = gymnasium.spaces.Box(-a_max, a_max, (2,), float)
        self.observation_space = gymnasium.spaces.Box(-FAR, FAR, (size,), float)

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        """Begin in the world of a new seed, or in that of the seed `options["world"]`."""
        super().reset(seed=seed)
        world = int((options or {}).get("world", self.np_random.integers(2**31)))
        self.scenario = self.scenarios(world)
        zoned = tuple(replace(person, zone=person.zone or self.zone) for person in self.scenario.people)
        self.crowd = self.behaviour.start(replace(self.scenario, people=zoned), world)
        keeps_out = {"walls": self.scenario.walls, "obstacles": self.scenario.obstacles}
        self.barriers = szlib.MPCCBF(self.zone, **keeps_out, settings=self.settings).barriers
        self.k, self.state, self.min_h = 0, self.robot.start(self.scenario.start), np.inf
        return self._look(), {"min_h": self.min_h, "world": world}

    def step(self, action):
        """Hold the acceleration `action` for one time step."""
        s, before = self.settings, self._distance()
        control = np.clip(np.asarray(action, float), -s.a_max, s.a_max)
        self.k, self.state = self.k + 1, self.robot.advance(self.state, control, s.dt)
        observation, speed = self._look(), hypot(*self.state[2:])
        penalty = 10 * max(0.0, -min(self.h, default=0.0)) + max(0.0, speed - s.v_max)
        arrived = self._distance() <= GOAL_RADIUS and speed <= STOPPED_SPEED
        late = self.k >= round(self.scenario.duration / s.dt)
        return observation, before - self._distance() - penalty, arrived, late, {"min_h": self.min_h}

    def _distance(self) -> float:
        return hypot(*(self.scenario.goal - self.state[:2]))

    def _look(self):
        """Take the people and barriers of now; return the observation."""
        at, velocity, dt = self.state[:2], self.state[2:], self.settings.dt
        self.people = [person for person in self.crowd(self.k * dt, self.state) if person is not None]
        self.h = self.barriers(at, self.people).tolist()
        self.min_h = min([self.min_h, *self.h])
        n = len(self.people)
        people = [(*(p.position - at), *p.velocity, h) for p, h in zip(self.people, self.h, strict=False)]
        people.sort(key=lambda row: hypot(*row[:2]))
        walls = [(*(wall - at).ravel(), h) for wall, h in zip(self.scenario.walls, self.h[n:], strict=False)]
        walls.sort(key=lambda row: row[4])
        rows = np.full((PEOPLE + WALLS, 5), FAR)
        for first, found in ((0, people[:PEOPLE]), (PEOPLE, walls[:WALLS])):
            rows[first : first + len(found)] = np.reshape(found, (-1, 5))
        return np.clip(np.concatenate([velocity, self.scenario.goal - at, rows.ravel()]), -FAR, FAR)


gymnasium.register("szlib/Social-v0", entry_point=SocialEnv)  # gymnasium.make("szlib/Social-v0", zone=...)

if __name__ == "__main__":
    env = SocialEnv()
    env.reset(seed=0)
    controller = szlib.MPCCBF(env.zone, walls=env.scenario.walls, settings=env.settings)
    total, done = 0.0, False
    while not done:
        control = controller.step(env.state, env.scenario.goal, env.people).control
        _, reward, arrived, late, info = env.step(control)
        total, done = total + reward, arrived or late
    print(
        f"{'arrived' if arrived else 'too late'} after {env.k} steps: reward {total:.2f}, min h {info['min_h']:.2f} m"
    )
