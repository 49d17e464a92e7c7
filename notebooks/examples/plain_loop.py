"""A robot's own loop, without any framework: `python plain_loop.py`.

Every 0.1 s it reads the robot's state and the people near it, takes one step of the controller, and sends one
command. Replace the three functions below by those of your robot.
"""

import szlib

WALLS = [[(-6.0, 2.3), (7.0, 2.3)]]  # segments [m]; or szlib.walls_from_map("map.yaml")
GOAL = (4.0, 0.0)
state = [-4.0, 0.0, 0.0, 0.0]  # x, y [m], vx, vy [m/s]


def read_odometry() -> list[float]:
    """Return x, y, vx, vy of the robot."""
    return state


def read_tracker(t: float) -> list[szlib.Person]:
    """Return the people near the robot at time `t` [s]; here one person comes towards it."""
    return [szlib.Person(position=(4.0 - 0.5 * t, 0.2), velocity=(-0.5, 0.0), id=1)]


def send_acceleration(ax: float, ay: float, dt: float) -> None:
    """Command the acceleration for `dt` [s]; here the robot follows it exactly."""
    x, y, vx, vy = state
    state[:] = x + vx * dt + ax * dt**2 / 2, y + vy * dt + ay * dt**2 / 2, vx + ax * dt, vy + ay * dt


def main(seconds: float = 30.0) -> bool:
    """Drive to the goal; return whether the robot arrived in time."""
    zone = szlib.reference_zone("grand-central-strangers").ellipse
    settings = szlib.MPCSettings.among_people()
    controller = szlib.MPCCBF(zone, walls=WALLS, settings=settings)
    for k in range(round(seconds / settings.dt)):
        t = k * settings.dt
        step = controller.step(read_odometry(), GOAL, read_tracker(t), now=t)
        if not step.safe:
            print(step.explain())
        if abs(state[0] - GOAL[0]) + abs(state[1] - GOAL[1]) < 0.2:
            print(f"arrived after {t:.1f} s")
            return True
        send_acceleration(*step.control, settings.dt)
    return False


if __name__ == "__main__":
    main()
